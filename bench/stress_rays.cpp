// SPDX-License-Identifier: Apache-2.0
#include "bench/stress_rays.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "bench/ray_reference.h"
#include "core/error.h"
#include "core/random.h"
#include "vdb/leaf_scatter.h"

namespace nerfvdb {
namespace {

constexpr int kChannels = 4;
const Vec3i kDims(40, 16, 16);
constexpr double kLength = 39;          // voxels along x
constexpr double kRounding = 0x1p-24;   // largest relative error of rounding to float
constexpr double kFlushed = 4e-38;      // exp(-87): what transmittances below are rounded to zero
constexpr double kDenormal = 0x1p-148;  // steps between the smallest floats
constexpr double kLeastSpoken = 1e-30;  // weights whose mean is formed (ray_tracer.cpp)

double random(double low, double high, std::uint64_t seed, std::uint64_t index) {
    return low + (high - low) * unitFloat(static_cast<std::uint32_t>(randomBits(seed, 11, index)));
}

/// How raw density changes along x: sigma is at most the scene's densest.
enum class Profile { constant, rough, walls };

struct Torture {
    Profile profile = Profile::constant;
    double sigma = 1;   // densest, per world unit
    double dt = 1;      // world length of a step
    int n = 100;        // steps along the box
    double centre = 0;  // world coordinate of the box's corner, all axes
    bool is_sparse = false;

    double stepVoxels() const { return kLength / n; }
    double voxel() const { return dt / stepVoxels(); }
    double tau() const { return sigma * dt; }
    std::string text() const {
        static const char* const kNames[] = {"constant", "rough", "walls"};
        char line[200];
        std::snprintf(line, sizeof line, "%s%s, sigma %.3g, dt %.3g, %d steps, centre %.3g",
                      is_sparse ? "sparse " : "", kNames[static_cast<int>(profile)], sigma, dt, n, centre);
        return line;
    }
};

/// The largest step of raw density from a voxel to the next, and its largest magnitude.
constexpr double slopeOf(Profile profile) {
    return profile == Profile::constant ? 0 : profile == Profile::rough ? 3 : 20;
}
constexpr double magnitudeOf(Profile profile) {
    return profile == Profile::constant ? 0 : profile == Profile::rough ? 3 : 20;
}

struct TortureField {
    VoxelField field;
    Occupancy occupancy;
    explicit TortureField(const Torture& torture) {
        std::vector<Topology::LeafCells> leaves;
        for (int x = 0; x < kDims.x() / kLeafDim; ++x)
            for (int y = 0; y < kDims.y() / kLeafDim; ++y)
                for (int z = 0; z < kDims.z() / kLeafDim; ++z) {
                    Topology::LeafCells leaf{Vec3i(x, y, z), {}};
                    for (int i = 0; i < kLeafVoxels; ++i) {
                        const Vec3i cell = leaf.leaf * kLeafDim + Vec3i(i >> 6, i >> 3 & 7, i & 7);
                        const bool exists = (cell.array() < kDims.array() - 1).all();
                        const bool is_chosen =
                            !torture.is_sparse ||
                            randomBits(5, static_cast<std::uint64_t>(cell.x()),
                                       static_cast<std::uint64_t>(cell.y() * 64 + cell.z())) %
                                3;
                        if (exists && is_chosen) setBit(leaf.cells, i);
                    }
                    leaves.push_back(leaf);
                }
        field = VoxelField(Topology(kDims, leaves), {Vec3d::Constant(torture.centre), torture.voxel()},
                           kChannels, torture.sigma);
        for (std::size_t i = 0; i < field.density().size(); ++i) {
            const std::uint64_t bits = randomBits(7, 0, i);
            float raw = 0;
            if (torture.profile == Profile::rough) raw = static_cast<float>(random(-3, 0, 8, i));
            if (torture.profile == Profile::walls) raw = bits % 2 ? 0.0f : kEmptyRaw;
            field.density()[i] = raw;
        }
        for (std::size_t i = 0; i < field.features().size(); ++i)
            field.features()[i] = static_cast<float>(random(0, 1, 9, i));
        occupancy = occupancyFromCells(field.topology(),
                                       {field.topology().cells().begin(), field.topology().cells().end()});
    }
};

struct NamedRay {
    const char* name;
    Vec3d origin, direction;  // index space
};

/// Rays of every awkward kind, in index space.
std::vector<NamedRay> tortureRays() {
    const double denormal = 5e-324, small = 1e-310;
    const double above = std::nextafter(8.0, 9.0), below = std::nextafter(8.0, 7.0);
    const Vec3d middle(19.5, 7.3, 6.6);
    return {{"through", {-7, 3.1, 9.2}, {1, 0.13, -0.07}},
            {"back", {60, 11.1, 2.2}, {-1, -0.11, 0.13}},
            {"from inside", middle, {0.9, -0.1, 0.2}},
            {"from inside, back", middle, {-0.9, 0.2, 0.1}},
            {"parallel to an axis", {-5, 7.3, 6.6}, {1, 0, 0}},
            {"in a face between leaves", {-5, 8, 6.6}, {1, 0, 0}},
            {"an ulp above that face", {-5, above, 6.6}, {1, 0, 0}},
            {"an ulp below that face", {-5, below, 6.6}, {1, 0, 0}},
            {"grazing that face", {-5, 8, 6.6}, {1, 1e-12, 0}},
            {"through that face at a hair's angle", {0, 7.99999, 6.6}, {1, 1e-6, 0}},
            {"along an edge of leaves", {-5, 8, 8}, {1, 0, 0}},
            {"in the box's lower face", {-5, 0, 6.6}, {1, 0, 0}},
            {"along the box's lower edge", {-5, 0, 0}, {1, 0, 0}},
            {"beside the box's upper face", {-5, 15 - 1e-4, 6.6}, {1, 0, 0}},
            {"denormal components", {-5, 7.3, 6.6}, {1, denormal, -small}},
            {"denormal components in a face", {-5, 8, 8}, {1, -denormal, small}},
            {"denormal components in the lower face", {-5, 0, 0}, {1, -denormal, small}},
            {"tiny components", {-5, 7.3, 8}, {1, 1e-30, -1e-20}},
            {"diagonal through corners", {0, 0, 0}, {1, 1, 1}},
            {"diagonal in a face", {8, 0, 8}, {1, 1, 0}},
            {"from a corner of a leaf", {8, 8, 8}, {0.7, 0.2, -0.1}},
            {"from far away", {-4e6, 7.3, 6.6}, {1, 0, 0}},
            {"from far away, aslant", {-4e5, -4e5 + 3, 6.6}, {1, 1.00001, 0}},
            {"from where no double sees the box", {-1e300, 7.3, 6.6}, {1, 0, 0}},
            {"beside the box", {-5, 16, 6.6}, {1, 0, 0}},
            {"away from the box", {-5, 7.3, 6.6}, {-1, 0, 0}}};
}

/// The grid of cases: sigma times dt spans nothing to a wall.
std::vector<Torture> tortureCases(bool is_long) {
    std::vector<Torture> cases;
    const std::vector<double> sigmas = is_long ? std::vector<double>{0, 1e-8, 1e-4, 1e-2, 1, 1e2, 1e4, 1e6, 1e8}
                                               : std::vector<double>{0, 1e-4, 1, 1e4, 1e8};
    const std::vector<double> steps = is_long ? std::vector<double>{1e-7, 1e-5, 1e-3, 1e-1, 1, 1e2, 1e4}
                                              : std::vector<double>{1e-7, 1e-3, 1, 1e4};
    const std::vector<int> counts = is_long ? std::vector<int>{1, 8, 78, 1000, 10000} : std::vector<int>{1, 78};
    const auto add = [&](double sigma, double dt, int n, Profile profile) {
        for (const double centre : {0.0, 1e7})
            for (const bool is_sparse : {false, true}) {
                const Torture torture{profile, sigma, dt, n, centre, is_sparse};
                // A double has steps of 2e-9 at 1e7: voxels below 1e-3 are no place there.
                if (centre != 0 && torture.voxel() < 1e-3) continue;
                cases.push_back(torture);
            }
    };
    for (const double sigma : sigmas)
        for (const double dt : steps)
            for (const int n : counts)
                for (const Profile profile : {Profile::rough, Profile::walls}) add(sigma, dt, n, profile);
    // Optical depth of a step chosen: alpha within an ulp of 1, and of 0; transmittance down to its underflow.
    for (const int n : {1, 78, 1000})
        for (const double tau : {0x1p-25, 0x1p-24, 16.6, 16.64, 17.4, 86.9, 87.1, 103.0, 80.0 / n, 88.0 / n,
                                 100.0 / n, 104.0 / n, 120.0 / n})
            for (const Profile profile : {Profile::constant, Profile::rough}) add(tau / 0.01, 0.01, n, profile);
    // So thin that the sum of weights has no inverse in single precision, or nearly.
    for (const double whole : {1e-45, 1e-40, 1e-38, 1e-36, 1e-31, 1e-29, 1e-20})
        for (const int n : {1, 78}) add(whole / n / 0.01, 0.01, n, Profile::rough);
    // As many samples as anyone has.
    for (const double whole : {1e-3, 1.0, 20.0, 100.0})
        for (const Profile profile : {Profile::constant, Profile::rough})
            if (is_long || (profile == Profile::rough && whole > 0.1 && whole < 50))
                cases.push_back({profile, whole / (1e5 * 0.01), 0.01, 100000, 0, false});
    return cases;
}

/// One ray of one case, traced and judged.
class RayJudge {
public:
    RayJudge()
        : found_{"ray", "samples that only the exact march finds, or only ours",
                 "none but within the next row's bound of a face"},
          place_{"ray", "place of a sample, voxels",
                 "6 roundings of coordinates and distances up to 45, and 3 of a double at the scene's centre"},
          tau_{"ray", "optical depth of a sample, relative",
               "10 roundings of the largest raw density at the corners, which exp makes relative, and 8"},
          opacity_{"ray", "opacity, samples given",
                   "tau exp(-tau) < 0.37 times the error of tau, and 8 roundings, for any number of samples"},
          colour_{"ray", "colour in [0, 1], samples given",
                  "twice the error of tau (total variation of the weights); 4 roundings a sample"},
          depth_{"ray", "depth, samples given, share of the ray in the box",
                 "as colour, in weights relative to their sum; 4 roundings of the distance"},
          gradient_{"ray", "gradient of a sample's density, share of its terms",
                    "the error of tau times the depth in front (at most 87, then light is zero); 8 roundings a "
                    "sample"},
          voxel_density_{"ray", "gradient of a voxel's density, share of its terms", "as of a sample"},
          voxel_features_{"ray", "gradient of a voxel's features, share of its terms",
                          "weights only: the error of tau times the depth in front; 8 roundings a sample"},
          whole_opacity_{"ray", "opacity of the whole ray",
                         "as above; the error of tau grows by the place's times the slope of raw density"},
          whole_colour_{"ray", "colour of the whole ray",
                        "as above, and the place's error times the slope of colour"},
          whole_depth_{"ray", "depth of the whole ray, share of the ray in the box", "as above"},
          finite_{"ray", "NaN or infinity in any output or gradient", "none"} {}

    void run(const Torture& torture) {
        const TortureField made(torture);
        const TraceScene scene(made.field, made.occupancy);
        const auto step = static_cast<float>(torture.stepVoxels());
        int number = 0;
        for (const NamedRay& named : tortureRays()) {
            const Vec3d direction = named.direction.normalized();
            const Ray ray{made.field.frame().worldFromIndex(named.origin), direction};
            float jitter = static_cast<float>(random(0, 1, 3, static_cast<std::uint64_t>(number++)));
            // Where a ray ends within rounding of a sample, whether it counts is nobody's fault.
            const ExactMarch first(scene, ray, step, jitter);
            if (first.hits() && std::abs(first.endPhase() - 0.5) > 0.45)
                jitter = jitter < 0.5f ? jitter + 0.3f : jitter - 0.3f;
            judge(torture, made, scene, ray, step, jitter,
                  [&] { return std::string(named.name) + "; " + torture.text(); });
        }
    }

    std::vector<StressRow> rows() const {
        return {found_,         place_,          tau_,           opacity_,      colour_,      depth_, gradient_,
                voxel_density_, voxel_features_, whole_opacity_, whole_colour_, whole_depth_, finite_};
    }

private:
    using Describe = std::function<std::string()>;

    void judge(const Torture& torture, const TortureField& made, const TraceScene& scene, const Ray& ray,
               float step, float jitter, const Describe& describe) {
        TraceOptions all;
        all.step_voxels = step;
        all.stop_transmittance = 0, all.min_weight = 0, all.max_dropped = 0;
        RayTracer tracer(1);
        tracer.addRay(scene, ray, step, jitter);
        TileGradients tile;
        tracer.trace(scene, all, tile.kept);
        const KeptSamples& kept = tile.kept;

        const ExactMarch march(scene, ray, step, jitter);
        const double centre_error = 3 * 0x1p-53 * (std::abs(torture.centre) / torture.voxel() + 4e6);
        const double place_error = 6 * kRounding * 45 + centre_error;
        std::vector<ExactSample> exact = march.samples();
        const bool finds_same = compareMarches(march, kept, exact, place_error, step, describe);

        // Given the samples.
        std::vector<ExactSample> given;
        for (int i = 0; i < kept.n; ++i)
            given.push_back({kept.leaf[i], kept.cell[i], kept.x[i], kept.y[i], kept.z[i], kept.t[i]});
        const ExactLight light = exactLight(scene, step, given);
        const double n = kept.n;
        const double tau_error = (10 * magnitudeOf(torture.profile) + 8) * kRounding;
        for (int i = 0; i < kept.n; ++i)
            if (light.tau[i] > kFlushed)
                tau_.add(static_cast<double>(std::abs(kept.tau[i] - light.tau[i]) / light.tau[i]), tau_error,
                         describe);
        const double share = std::max(1.0, static_cast<double>(march.length()));
        compareLight(tracer, kept, light, share, tau_error, 0, n, {opacity_, colour_, depth_}, describe);

        std::vector<float> dl_dmean(kChannels);
        for (int c = 0; c < kChannels; ++c)
            dl_dmean[c] = static_cast<float>(random(-1, 1, 21, static_cast<std::uint64_t>(c)));
        const float dl_dtransmittance = 0.7f, dl_ddistortion = 0.02f;
        tile.dl_dray_features = dl_dmean;
        tracer.traceBackward(scene, tile.dl_dray_features.data(), &dl_dtransmittance, dl_ddistortion,
                             tile.kept);
        bool is_finite = true;
        for (int i = 0; i < kept.n; ++i)
            is_finite = is_finite && std::isfinite(kept.dl_draw[i]) && std::isfinite(kept.weight[i]) &&
                        std::isfinite(kept.tau[i]);
        for (int c = 0; c < kChannels; ++c)
            is_finite =
                is_finite && std::isfinite(tile.dl_dray_features[c]) && std::isfinite(tracer.rayFeatures()[c]);
        finite_.check(is_finite && std::isfinite(tracer.transmittance()[0]) && std::isfinite(tracer.entry()[0]),
                      describe);
        if (light.weight_sum >= kLeastSpoken) {
            const ExactGradient gradient =
                exactGradient(scene, given, light, dl_dmean, dl_dtransmittance, dl_ddistortion);
            const double error = 90 * tau_error + (8 * n + 60) * kRounding;
            for (int i = 0; i < kept.n; ++i) {
                const Exact floor = light.tau[i] * gradient.largest_slope * kFlushed + kDenormal;
                addShare(gradient_, kept.dl_draw[i], gradient.dl_draw[i], gradient.magnitude[i], floor, error,
                         describe);
            }
            if (kept.n <= 2000) compareVoxels(made.field, tile, light, gradient, dl_dmean, error, describe);
        }

        if (torture.is_sparse || !finds_same) return;
        // Whole rays through fields without borders inside.
        const double slope = 2 * slopeOf(torture.profile);  // along a diagonal
        const ExactLight whole = exactLight(scene, step, exact);
        compareLight(tracer, kept, whole, share, tau_error + slope * place_error, 2 * place_error, n,
                     {whole_opacity_, whole_colour_, whole_depth_}, describe);
    }

    bool compareMarches(const ExactMarch& march, const KeptSamples& kept, const std::vector<ExactSample>& exact,
                        double place_error, float step, const Describe& describe) {
        std::size_t e = 0;
        bool finds_same = true;
        for (int i = 0; i <= kept.n; ++i) {
            const Exact t = i < kept.n ? static_cast<Exact>(kept.t[i]) : std::numeric_limits<Exact>::infinity();
            // What lies in front of it in the exact march alone.
            for (; e < exact.size() && exact[e].t < t - 0.5 * step; ++e) {
                const auto k = static_cast<std::int64_t>(std::llround((exact[e].t - march.t(0)) / step));
                found_.check(march.faceDistance(k) <= place_error, describe);
                finds_same = false;
            }
            if (i == kept.n) break;
            const auto k = static_cast<std::int64_t>(std::llround((t - march.t(0)) / step));
            if (e < exact.size() && std::abs(exact[e].t - t) < 0.5 * step) {
                ++e;
                found_.check(true);
            } else {
                found_.check(march.faceDistance(k) <= place_error, describe);
                finds_same = false;
            }
            const float fraction[3] = {kept.x[i], kept.y[i], kept.z[i]};
            const int local[3] = {kept.cell[i] >> 6, kept.cell[i] >> 3 & 7, kept.cell[i] & 7};
            double error = 0;
            for (int axis = 0; axis < 3; ++axis) {
                const Exact p =
                    leafOrigin(kept.leaf[i], axis) + local[axis] + static_cast<Exact>(fraction[axis]);
                error = std::max(error, static_cast<double>(std::abs(p - march.position(k, axis))));
            }
            place_.add(error, place_error, describe);
        }
        return finds_same;
    }

    /// Leaves of these fields are all there, numbered in the order of their coordinates.
    static Exact leafOrigin(std::int32_t leaf, int axis) {
        const Vec3i leaves = kDims / kLeafDim;
        const int coord[3] = {leaf / (leaves.y() * leaves.z()), leaf / leaves.z() % leaves.y(),
                              leaf % leaves.z()};
        return coord[axis] * kLeafDim;
    }

    struct LightRows {
        StressRow &opacity, &colour, &depth;
    };

    static void compareLight(RayTracer& tracer, const KeptSamples& kept, const ExactLight& light, double length,
                             double tau_error, double place_error, double n, const LightRows& rows,
                             const Describe& describe) {
        const Exact opacity = 1 - light.transmittance;
        const double found = 1 - static_cast<double>(tracer.transmittance()[0]);
        rows.opacity.add(static_cast<double>(std::abs(found - opacity)), 0.37 * tau_error + 8 * kRounding,
                         describe);
        for (int c = 0; c < kChannels; ++c)
            rows.colour.add(
                static_cast<double>(std::abs(found * tracer.rayFeatures()[c] - opacity * light.mean[c])),
                2 * tau_error + place_error + (4 * n + 24) * kRounding, describe);
        if (!(light.weight_sum >= kLeastSpoken)) return;
        float depth = 0;
        for (int i = 0; i < kept.n; ++i) depth += kept.weight[i] * kept.t[i];
        rows.depth.add(static_cast<double>(std::abs(depth / tracer.weight()[0] - light.depth)) / length,
                       4 * tau_error + place_error + (6 * n + 24) * kRounding, describe);
    }

    static void addShare(StressRow& row, Exact found, Exact expected, Exact magnitude, Exact floor,
                         double error, const Describe& describe) {
        const Exact difference = std::abs(found - expected);
        if (difference <= floor) return row.add(0, error, describe);
        row.add(static_cast<double>((difference - floor) / magnitude), error, describe);
    }

    void compareVoxels(const VoxelField& field, TileGradients& tile, const ExactLight& light,
                       const ExactGradient& gradient, const std::vector<float>& dl_dmean, double error,
                       const Describe& describe) {
        const std::size_t size = field.density().size();
        struct Sum {
            Exact value = 0, magnitude = 0, floor = 0;
        };
        std::vector<Sum> density(size), feature(size);  // of the first channel
        const KeptSamples& kept = tile.kept;
        const Bricks corners{.upper_neighbours = field.topology().upperNeighbours().data()};
        for (int i = 0; i < kept.n; ++i)
            for (int corner = 0; corner < 8; ++corner) {
                const std::size_t voxel = cornerIndex(corners, kept.leaf[i], kept.cell[i], corner);
                const Exact weight = (corner & 4 ? kept.x[i] : 1 - static_cast<Exact>(kept.x[i])) *
                                     (corner & 2 ? kept.y[i] : 1 - static_cast<Exact>(kept.y[i])) *
                                     (corner & 1 ? kept.z[i] : 1 - static_cast<Exact>(kept.z[i]));
                density[voxel].value += weight * gradient.dl_draw[i];
                density[voxel].magnitude += weight * gradient.magnitude[i];
                density[voxel].floor += light.tau[i] * gradient.largest_slope * kFlushed + kDenormal;
                const Exact slope = dl_dmean[0] / light.weight_sum;
                feature[voxel].value += weight * light.weight[i] * slope;
                feature[voxel].magnitude += weight * light.weight[i] * std::abs(slope);
                feature[voxel].floor += kFlushed * std::abs(slope) + kDenormal;
            }
        tile.bin(field.topology(), kChannels);
        LeafScatter scatter;
        std::vector<float> found_density(size), found_feature(size);
        scatter.run(field.topology(), kChannels, {&tile, 1},
                    [&](std::int32_t leaf, const LeafGradient& found, const LeafMask&) {
                        for (int v = 0; v < kLeafVoxels; ++v) {
                            const std::size_t voxel =
                                static_cast<std::size_t>(leaf) * kLeafVoxels + static_cast<std::size_t>(v);
                            found_density[voxel] = found.density[v];
                            found_feature[voxel] = found.features[v * kChannels];
                            found.density[v] = 0;
                            std::fill_n(found.features + v * kChannels, kChannels, 0.0f);
                        }
                        std::fill_n(found.touched, kLeafWords, std::uint64_t{0});
                    });
        for (std::size_t v = 0; v < size; ++v) {
            if (density[v].magnitude > 0)
                addShare(voxel_density_, found_density[v], density[v].value, density[v].magnitude,
                         density[v].floor, error, describe);
            if (feature[v].magnitude > 0)
                addShare(voxel_features_, found_feature[v], feature[v].value, feature[v].magnitude,
                         feature[v].floor, error, describe);
        }
    }

    StressRow found_, place_, tau_, opacity_, colour_, depth_, gradient_, voxel_density_, voxel_features_,
        whole_opacity_, whole_colour_, whole_depth_, finite_;
};

}  // namespace

std::vector<StressRow> stressRays(const RayStressOptions& options, Report& report) {
    RayJudge judge;
    const std::vector<Torture> cases = tortureCases(options.is_long);
    report.begin("rays", static_cast<std::int64_t>(cases.size()));
    for (std::size_t i = 0; i < cases.size(); i += options.every) {
        if (report.cancelled()) throw Interrupted("stopped while rays were judged, as asked");
        judge.run(cases[i]);
        report.update(static_cast<std::int64_t>(i) + 1, "");
    }
    report.end();
    return judge.rows();
}

}  // namespace nerfvdb
