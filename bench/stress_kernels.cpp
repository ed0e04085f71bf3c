// SPDX-License-Identifier: Apache-2.0
#include "bench/stress_kernels.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/random.h"
#include "vdb/occupancy.h"

namespace nerfvdb {
namespace {

constexpr double kPromised = 1e-5;  // kernels.h
constexpr int kChannels = 8, kMost = 67, kRays = 5;
const char* const kPromise = "what kernels.h promises, relative to the sum of the magnitudes of a sum's terms";

float random(float low, float high, std::uint64_t seed, std::uint64_t index) {
    return low + (high - low) * unitFloat(static_cast<std::uint32_t>(randomBits(seed, 12, index)));
}

using Floats = std::vector<float>;
Floats randomFloats(std::size_t n, float low, float high, std::uint64_t seed) {
    Floats values(n);
    for (std::size_t i = 0; i < n; ++i) values[i] = random(low, high, seed, i);
    return values;
}
/// Values of every size, both signs, zeros and denormals, none beyond `largest`.
Floats extremes(std::size_t n, float largest, std::uint64_t seed) {
    const std::array<float, 12> kinds = {0.0f, -0.0f, 1e-45f, -1e-45f, 1e-38f,  -1e-38f,
                                         1.0f, -1.0f, 87.5f,  -103.5f, largest, -largest};
    Floats values(n);
    for (std::size_t i = 0; i < n; ++i)
        values[i] = std::clamp(kinds[randomBits(seed, 13, i) % kinds.size()], -largest, largest);
    return values;
}
Floats magnitudes(const Floats& values) {
    Floats result(values);
    for (float& value : result) value = std::abs(value);
    return result;
}

/// Points in a dense field of 2 x 2 x 2 leaves.
struct Points {
    VoxelField field;
    Occupancy occupancy;
    Bricks bricks;
    std::vector<std::int32_t> leaf, cell, ray;
    Floats x, y, z, t, weight;

    Points(const Floats& raw, const Floats& features, bool has_extreme_places) {
        std::vector<Topology::LeafCells> leaves;
        for (int l = 0; l < 8; ++l) {
            Topology::LeafCells entry{Vec3i(l >> 2, l >> 1 & 1, l & 1), {}};
            for (int i = 0; i < kLeafVoxels; ++i) {
                const Vec3i at = entry.leaf * kLeafDim + Vec3i(i >> 6, i >> 3 & 7, i & 7);
                if ((at.array() < 15).all()) setBit(entry.cells, i);
            }
            leaves.push_back(entry);
        }
        field = VoxelField(Topology(Vec3i::Constant(16), leaves), {}, kChannels, 1.0);
        std::copy(raw.begin(), raw.end(), field.density().begin());
        std::copy(features.begin(), features.end(), field.features().begin());
        occupancy = occupancyFromCells(field.topology(),
                                       {field.topology().cells().begin(), field.topology().cells().end()});
        bricks = bricksOf(field, occupancy);
        constexpr float kPlaces[] = {0.0f, 1.0f, 1e-45f, 0x1.fffffep-1f, 0.5f};
        const std::size_t size = kMost + kPadding;
        leaf.resize(size), cell.resize(size), ray.resize(size);
        for (auto* array : {&x, &y, &z, &t, &weight}) array->resize(size);
        for (std::size_t i = 0; i < kMost; ++i) {
            leaf[i] = static_cast<std::int32_t>(randomBits(1, 0, i) % 8);
            do
                cell[i] = static_cast<std::int32_t>(randomBits(2, static_cast<std::uint64_t>(cell[i]), i) %
                                                    kLeafVoxels);
            while (!testBit(field.topology().cells()[leaf[i]], cell[i]));
            ray[i] = static_cast<std::int32_t>(i * kRays / kMost);
            const auto place = [&](std::uint64_t seed) {
                return has_extreme_places ? kPlaces[randomBits(seed, 3, i) % 5] : random(0, 1, seed, i);
            };
            x[i] = place(31), y[i] = place(32), z[i] = place(33), weight[i] = place(34);
        }
    }
    SampleArrays arrays() { return {leaf.data(), cell.data(), x.data(), y.data(), z.data(), t.data()}; }
};

/// Rows of one instruction set, and the comparisons that fill them.
class KernelJudge {
public:
    explicit KernelJudge(const std::string& target)
        : area_("target " + target),
          density_(row("densityForward: raw, tau, alpha, decay; sigmaForward")),
          features_(row("featuresForward, rowDots")),
          scatter_(row("accumulateLeaf")),
          voxels_(row("rmsPropLeaf")),
          network_(row("layerForward, both backward")),
          adam_(row("adamStep")),
          finite_{area_, "NaN or infinity from finite input",
                  "none: raw to 3e38, features to 1e18, gradients to 1e18, products of layers to 1e34"} {}

    std::vector<StressRow> rows() {
        compareSamples();
        compareLeaf();
        compareNetwork();
        compareAdam();
        return {density_, features_, scatter_, voxels_, network_, adam_, finite_};
    }

private:
    StressRow row(const char* name) const { return {area_, name, kPromise}; }

    static void compare(StressRow& row, const Floats& found, const Floats& expected, std::size_t n,
                        const std::function<double(std::size_t)>& magnitude) {
        for (std::size_t i = 0; i < n; ++i) {
            const double most = magnitude(i);
            const double difference = std::abs(static_cast<double>(found[i]) - expected[i]);
            row.add(most > 0 ? difference / most : difference, kPromised,
                    [&] { return "element " + std::to_string(i) + " of " + std::to_string(n); });
        }
    }
    void checkFinite(const Floats& values, std::size_t n, float low, float high, const char* what) {
        bool holds = true;
        for (std::size_t i = 0; i < n; ++i) holds = holds && values[i] >= low && values[i] <= high;
        finite_.check(holds, [&] { return std::string(what); });
    }
    static constexpr float kHuge = 3.402823e38f;

    void compareSamples() {
        const std::size_t size = kMost + kPadding;
        const Floats raw = randomFloats(8 * kLeafVoxels, -30, 30, 1),
                     value = randomFloats(8 * kLeafVoxels * kChannels, -1, 1, 2);
        Points points(raw, value, false);
        for (int n = 0; n <= kMost; ++n) {
            const auto count = static_cast<std::size_t>(n);
            std::array<std::array<Floats, 4>, 2> out;
            for (auto& side : out)
                for (Floats& array : side) array.resize(size);
            const auto run = [&](auto kernel, std::array<Floats, 4>& o) {
                kernel(points.bricks, n, points.arrays(), 15.0f, 0.9f, o[0].data(), o[1].data(), o[2].data(),
                       o[3].data());
            };
            run(&reference::densityForward, out[0]);
            run(&simd::densityForward, out[1]);
            // The trilinear sum's error, relative to 30, is exp's relative error and decay's absolute one.
            compare(density_, out[1][0], out[0][0], count, [](std::size_t) { return 30.0; });
            compare(density_, out[1][1], out[0][1], count, [&](std::size_t i) { return 30.0 * out[0][1][i]; });
            compare(density_, out[1][2], out[0][2], count, [&](std::size_t i) { return 30.0 * out[0][2][i]; });
            compare(density_, out[1][3], out[0][3], count, [](std::size_t) { return 30 * 0.37; });

            std::array<Floats, 2> feature, sums, dots;
            for (int side = 0; side < 2; ++side) {
                feature[side].resize(size * kChannels), sums[side].resize((kRays + kPadding) * kChannels);
                dots[side].resize(size);
                (side ? simd::featuresForward : reference::featuresForward)(
                    points.bricks, n, points.arrays(), points.ray.data(), points.weight.data(),
                    feature[side].data(), sums[side].data());
                (side ? simd::rowDots : reference::rowDots)(n, kChannels, feature[0].data(), points.ray.data(),
                                                            sums[0].data(), dots[side].data());
            }
            compare(features_, feature[1], feature[0], count * kChannels, [](std::size_t) { return 1.0; });
            const double share =
                std::max(1.0, n / static_cast<double>(kRays));  // samples a ray, each at most 1
            compare(features_, sums[1], sums[0], kRays * kChannels, [&](std::size_t) { return share; });
            compare(features_, dots[1], dots[0], count, [&](std::size_t) { return kChannels * share; });
        }
        Points rough(extremes(raw.size(), 3e38f, 3), extremes(value.size(), 1e18f, 4), true);
        std::array<Floats, 4> out;
        for (Floats& array : out) array.resize(size);
        for (const float scale : {0.0f, 1e-45f, 1e-38f, 1.0f, 1e30f}) {
            simd::densityForward(rough.bricks, kMost, rough.arrays(), 15.0f, scale, out[0].data(),
                                 out[1].data(), out[2].data(), out[3].data());
            checkFinite(out[0], kMost, -kHuge, kHuge, "raw");
            checkFinite(out[1], kMost, 0, kHuge, "tau");
            checkFinite(out[2], kMost, 0, 1, "alpha");
            checkFinite(out[3], kMost, 0, 1, "decay");
        }
        Floats feature(size * kChannels), sums((kRays + kPadding) * kChannels), dots(size);
        simd::featuresForward(rough.bricks, kMost, rough.arrays(), rough.ray.data(), rough.weight.data(),
                              feature.data(), sums.data());
        simd::rowDots(kMost, kChannels, feature.data(), rough.ray.data(), sums.data(), dots.data());
        checkFinite(feature, kMost * kChannels, -kHuge, kHuge, "features");
        checkFinite(sums, kRays * kChannels, -kHuge, kHuge, "sums of features");
        checkFinite(dots, kMost, -kHuge, kHuge, "products of rows");
        Points sigmas(randomFloats(raw.size(), 0, 100, 5), value, false);
        for (const float scale : {1e-38f, 1e-6f, 1.0f, 1e30f}) {
            std::array<std::array<Floats, 3>, 2> light;
            for (int side = 0; side < 2; ++side) {
                for (Floats& array : light[side]) array.resize(size);
                (side ? simd::sigmaForward : reference::sigmaForward)(
                    sigmas.bricks, kMost, sigmas.arrays(), scale, light[side][0].data(), light[side][1].data(),
                    light[side][2].data());
            }
            compare(density_, light[1][0], light[0][0], kMost, [&](std::size_t) { return 100.0 * scale; });
            compare(density_, light[1][1], light[0][1], kMost, [&](std::size_t i) { return light[0][1][i]; });
            compare(density_, light[1][2], light[0][2], kMost, [](std::size_t) { return 1.0; });
        }
    }

    /// One leaf, with what its samples contribute.
    struct Leaf {
        Floats density = Floats(512 + kPadding), features = Floats(512 * kChannels + kPadding);
        Floats density_moment = Floats(512 + kPadding), feature_moment = Floats(512 + kPadding);
        Floats density_gradient = Floats(512 + kPadding), feature_gradient = Floats(512 * kChannels + kPadding);
        std::array<std::uint64_t, 8> touched{};
        LeafGradient gradient() { return {density_gradient.data(), feature_gradient.data(), touched.data()}; }
    };

    void compareLeaf() {
        Floats slopes = randomFloats(kChannels * kMost, -1, 1, 6);
        std::vector<SampleGradient> samples;
        std::vector<LeafContribution> contributions;
        for (std::uint64_t i = 0; i < kMost; ++i) {
            const std::uint64_t bits = randomBits(7, 0, i);
            const auto cell = static_cast<std::int32_t>(bits % kLeafVoxels);
            samples.push_back({cell, random(0, 1, 8, i), random(0, 1, 9, i), random(0, 1, 10, i), random(0, 1, 11, i),
                               random(-1, 1, 12, i), &slopes[i * kChannels]});
            // By its own corners, or by those beyond faces that it lies at.
            const unsigned crossed = (cell >> 6 == 7) * 4 + ((cell >> 3 & 7) == 7) * 2 + ((cell & 7) == 7);
            contributions.push_back({nullptr, 0, static_cast<std::uint32_t>(bits >> 32) & crossed});
        }
        for (std::size_t i = 0; i < samples.size(); ++i) contributions[i].sample = &samples[i];
        contributions.resize(kMost + kPadding);
        std::array<Leaf, 2> leaves;
        const std::array<std::uint64_t, 8> active = {~0ull, ~0ull, 0x00ff00ff00ff00ffull, ~0ull,
                                                     0,     ~0ull, 0x5555555555555555ull, ~0ull};
        const RmsPropRates rates{0.2f, 0.03f, 0.95f, 1e-4f, 0.01f, 0.03f, 0.2f};
        for (int side = 0; side < 2; ++side) {
            Leaf& leaf = leaves[side];
            leaf.density = randomFloats(512 + kPadding, -5, 5, 13);
            leaf.features = randomFloats(512 * kChannels + kPadding, -1, 1, 14);
            (side ? simd::accumulateLeaf : reference::accumulateLeaf)(kMost, contributions.data(), kChannels,
                                                                      leaf.gradient());
        }
        compare(scatter_, leaves[1].density_gradient, leaves[0].density_gradient, 512,
                [](std::size_t) { return 1.0; });
        compare(scatter_, leaves[1].feature_gradient, leaves[0].feature_gradient, 512 * kChannels,
                [](std::size_t) { return 1.0; });
        for (int step = 0; step < 3; ++step) {
            for (int side = 0; side < 2; ++side) {
                Leaf& leaf = leaves[side];
                leaf.density_gradient = randomFloats(512 + kPadding, -1, 1, 15 + step);
                leaf.feature_gradient = randomFloats(512 * kChannels + kPadding, -1, 1, 25 + step);
                leaf.touched = active;
                (side ? simd::rmsPropLeaf : reference::rmsPropLeaf)(
                    kChannels, rates, active.data(), leaf.gradient(), leaf.density.data(),
                    leaf.density_moment.data(), leaf.features.data(), leaf.feature_moment.data());
            }
            compare(voxels_, leaves[1].density, leaves[0].density, 512, [](std::size_t) { return 5.0; });
            compare(voxels_, leaves[1].features, leaves[0].features, 512 * kChannels,
                    [](std::size_t) { return 1.0; });
            compare(voxels_, leaves[1].feature_moment, leaves[0].feature_moment, 512,
                    [](std::size_t) { return 1.0; });
        }
        Leaf rough;
        rough.density = extremes(512 + kPadding, 1e30f, 16);
        rough.features = extremes(512 * kChannels + kPadding, 1e18f, 17);
        for (int step = 0; step < 3; ++step) {
            rough.density_gradient = extremes(512 + kPadding, 1e18f, 18 + step);
            rough.feature_gradient = extremes(512 * kChannels + kPadding, 1e18f, 28 + step);
            rough.touched = active;
            simd::rmsPropLeaf(kChannels, rates, active.data(), rough.gradient(), rough.density.data(),
                              rough.density_moment.data(), rough.features.data(), rough.feature_moment.data());
        }
        checkFinite(rough.density, 512, -kHuge, kHuge, "densities after a step");
        checkFinite(rough.density_moment, 512, 0, kHuge, "moments of densities");
        checkFinite(rough.features, 512 * kChannels, -kHuge, kHuge, "features after a step");
        checkFinite(rough.feature_moment, 512, 0, kHuge, "moments of features");
    }

    void compareNetwork() {
        for (const int n : {1, 15, 16, 17, 50, 67})
            for (const int n_in : {1, 25, 128})
                for (const int n_out : {1, 3, 128}) {
                    constexpr int kStride = 80;
                    const auto size = [&](int rows) {
                        return static_cast<std::size_t>(rows * kStride + kPadding);
                    };
                    const std::size_t n_weights = static_cast<std::size_t>(n_in * n_out);
                    const Floats weights = randomFloats(n_weights + kPadding, -1, 1, 40),
                                 bias = randomFloats(n_out + kPadding, -1, 1, 41);
                    const Floats in = randomFloats(size(n_in), -1, 1, 42);
                    Floats slope = randomFloats(size(n_out), -1, 1, 43);
                    for (int o = 0; o < n_out; ++o) std::fill_n(&slope[o * kStride + n], kStride - n, 0.0f);
                    // Magnitudes: the same sums of the magnitudes of the terms.
                    struct Out {
                        Floats out, dl_din, dl_dweights, dl_dbias;
                    };
                    const auto run = [&](bool is_fast, const Floats& w, const Floats& b, const Floats& i,
                                         const Floats& s) {
                        Out result{Floats(size(n_out)), Floats(size(n_in)), Floats(n_weights + kPadding),
                                   Floats(n_out + kPadding)};
                        (is_fast ? simd::layerForward : reference::layerForward)(
                            n, kStride, n_in, n_out, w.data(), b.data(), false, i.data(), result.out.data());
                        (is_fast ? simd::layerBackwardInput : reference::layerBackwardInput)(
                            n, kStride, n_in, n_out, w.data(), s.data(), nullptr, result.dl_din.data());
                        (is_fast ? simd::layerBackwardWeights : reference::layerBackwardWeights)(
                            n, kStride, n_in, n_out, s.data(), i.data(), result.dl_dweights.data(),
                            result.dl_dbias.data());
                        return result;
                    };
                    const Out expected = run(false, weights, bias, in, slope),
                              found = run(true, weights, bias, in, slope);
                    const Out most =
                        run(false, magnitudes(weights), magnitudes(bias), magnitudes(in), magnitudes(slope));
                    const auto judge = [&](Floats Out::*array, std::size_t count) {
                        compare(network_, found.*array, expected.*array, count,
                                [&](std::size_t i) { return static_cast<double>((most.*array)[i]); });
                    };
                    for (int o = 0; o < n_out; ++o)
                        for (int b = 0; b < n; ++b) {
                            const auto i = static_cast<std::size_t>(o * kStride + b);
                            network_.add(
                                std::abs(static_cast<double>(found.out[i]) - expected.out[i]) / most.out[i],
                                kPromised);
                        }
                    for (int o = 0; o < n_in; ++o)
                        for (int b = 0; b < n; ++b) {
                            const auto i = static_cast<std::size_t>(o * kStride + b);
                            network_.add(std::abs(static_cast<double>(found.dl_din[i]) - expected.dl_din[i]) /
                                             most.dl_din[i],
                                         kPromised);
                        }
                    judge(&Out::dl_dweights, n_weights);
                    judge(&Out::dl_dbias, static_cast<std::size_t>(n_out));
                    if (n_in != 128) continue;
                    const Out rough =
                        run(true, extremes(weights.size(), 1e17f, 44), extremes(bias.size(), 1e17f, 45),
                            extremes(in.size(), 1e17f, 46), slope);
                    for (int o = 0; o < n_out; ++o)
                        checkFinite(Floats(&rough.out[o * kStride], &rough.out[o * kStride] + n),
                                    static_cast<std::size_t>(n), -kHuge, kHuge, "a layer's output");
                    checkFinite(rough.dl_dweights, n_weights, -kHuge, kHuge, "gradients of weights");
                }
    }

    void compareAdam() {
        const AdamRates rates{0.9f, 0.99f, 1e-8f, 1e-3f, 10.0f, 100.0f};
        for (const int n : {1, 15, 16, 33, 67}) {
            const auto size = static_cast<std::size_t>(n);
            std::array<std::array<Floats, 3>, 2> sides;
            for (int side = 0; side < 2; ++side)
                sides[side] = {randomFloats(size, -1, 1, 50), randomFloats(size, 0, 1, 51),
                               randomFloats(size, -1, 1, 52)};
            const Floats gradients = randomFloats(size, -1, 1, 53);
            for (int side = 0; side < 2; ++side)
                (side ? simd::adamStep : reference::adamStep)(n, rates, gradients.data(), sides[side][0].data(),
                                                              sides[side][1].data(), sides[side][2].data());
            for (int array = 0; array < 3; ++array)
                compare(adam_, sides[1][array], sides[0][array], size, [](std::size_t) { return 1.0; });
            Floats first(size), second(size), parameters = extremes(size, 1e30f, 54);
            for (int step = 0; step < 3; ++step) {
                const Floats rough =
                    extremes(size, 1e17f, 55 + step);  // the second moment's scale is 100 at first
                simd::adamStep(n, rates, rough.data(), first.data(), second.data(), parameters.data());
            }
            checkFinite(first, size, -kHuge, kHuge, "first moments");
            checkFinite(second, size, 0, kHuge, "second moments");
            checkFinite(parameters, size, -kHuge, kHuge, "parameters");
        }
    }

    std::string area_;
    StressRow density_, features_, scatter_, voxels_, network_, adam_, finite_;
};

}  // namespace

std::vector<StressRow> stressKernels(Report& report) {
    const simd::KeepTarget keep;
    const std::vector<std::string> targets = simd::supportedTargets();
    report.begin("instruction sets", static_cast<std::int64_t>(targets.size()));
    StressRow forced("targets", "instruction sets that this machine runs, each forced and then in use",
                     "all of them");
    std::vector<StressRow> all;
    for (std::size_t t = 0; t < targets.size(); ++t) {
        const bool is_forced = simd::forceTarget(targets[t]) && simd::activeTarget() == targets[t];
        forced.check(is_forced, [&] { return targets[t]; });
        const std::vector<StressRow> rows = KernelJudge(targets[t]).rows();
        all.insert(all.end(), rows.begin(), rows.end());
        report.update(static_cast<std::int64_t>(t) + 1, targets[t]);
    }
    report.end();
    all.insert(all.begin(), forced);
    return all;
}

}  // namespace nerfvdb
