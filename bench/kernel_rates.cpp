// SPDX-License-Identifier: Apache-2.0
#include "bench/kernel_rates.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <numeric>

#include "bench/repeat.h"
#include "bench/result_plot.h"
#include "core/camera.h"
#include "core/huge_array.h"
#include "core/random.h"
#include "core/simd/kernels.h"
#include "trainer/sample_scene.h"
#include "vdb/decoder.h"
#include "vdb/occupancy.h"

namespace nerfvdb {
namespace {

constexpr int kTileEdge = 16, kTileRays = kTileEdge * kTileEdge;
constexpr int kStepsPerRound = 32;
constexpr int kMostSamples = 128 * kTileRays;  // of a tile
constexpr int kHidden = kDecoderWidth;  // width of the network's layers
constexpr float kStep = 0.5f;
constexpr int kYardstickRounds = 10000;
constexpr double kExp = 10;  // operations that an exponential counts as

float noise(std::uint64_t stream, std::uint64_t index) {
    return 2 * unitFloat(static_cast<std::uint32_t>(randomBits(3, stream, index))) - 1;
}

std::vector<float> noises(std::uint64_t stream, std::size_t n) {
    std::vector<float> values(n + kPadding);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = noise(stream, i);
    return values;
}

/// The kernels of one namespace.
struct KernelSet {
    decltype(&simd::marchRays) march;
    decltype(&simd::densityForward) density;
    decltype(&simd::featuresForward) features;
    decltype(&simd::rowDots) dots;
    decltype(&simd::accumulateLeaf) accumulate;
    decltype(&simd::rmsPropLeaf) optimise;
    decltype(&simd::layerForward) layer;
    decltype(&simd::layerBackwardInput) layer_input;
    decltype(&simd::layerBackwardWeights) layer_weights;
    decltype(&simd::adamStep) adam;
};

constexpr KernelSet kSimd = {&simd::marchRays,    &simd::densityForward,     &simd::featuresForward,
                             &simd::rowDots,      &simd::accumulateLeaf,     &simd::rmsPropLeaf,
                             &simd::layerForward, &simd::layerBackwardInput, &simd::layerBackwardWeights,
                             &simd::adamStep};
constexpr KernelSet kReference = {
    &reference::marchRays,    &reference::densityForward,     &reference::featuresForward,
    &reference::rowDots,      &reference::accumulateLeaf,     &reference::rmsPropLeaf,
    &reference::layerForward, &reference::layerBackwardInput, &reference::layerBackwardWeights,
    &reference::adamStep};

/// The sphere's voxels with features of noise.
VoxelField noisyField(int resolution, int channels) {
    const Model sphere = sampleScene(*makeSyntheticScene("sphere"), resolution);
    VoxelField field(sphere.field.topology(), sphere.field.frame(), channels, sphere.field.densityScale());
    std::copy(sphere.field.density().begin(), sphere.field.density().end(), field.density().begin());
    for (std::size_t i = 0; i < field.features().size(); ++i) field.features()[i] = noise(1, i);
    return field;
}

/// A tile of rays and its samples, as the tracer would hold them.
struct Tile {
    std::vector<float> ox, oy, oz, dx, dy, dz, length, offset;
    std::vector<std::int32_t> next, alive, begin;
    std::vector<std::int32_t> leaf, cell, ray;
    std::vector<float> x, y, z, t, raw, tau, alpha, decay, features, ray_features, dots;
    int n = 0;  // samples

    RayTile rays() {
        return {kTileRays, ox.data(), oy.data(),     oz.data(),     dx.data(),
                dy.data(), dz.data(), length.data(), offset.data(), next.data()};
    }
    SampleArrays samples() { return {leaf.data(), cell.data(), x.data(), y.data(), z.data(), t.data()}; }
};

/// Everything the kernels read and write.
class KernelData {
public:
    KernelData(const KernelOptions& options)
        : channels(options.channels),
          field(noisyField(options.resolution, channels)),
          occupancy(findOccupied(field, 0.01f)),
          bricks(bricksOf(field, occupancy)) {
        makeTiles(options.tiles);
        makeLeaf();
        for (auto* rows : {&layer_in, &layer_out, &layer_gradient})
            *rows = noises(4, static_cast<std::size_t>(kHidden) * kTileRays);
        weights = noises(5, kHidden * kHidden);
        bias = noises(6, kHidden);
        weight_gradient.assign(kHidden * kHidden + kPadding, 0.0f);
        bias_gradient.assign(kHidden + kPadding, 0.0f);
        adam_first = noises(17, kHidden * kHidden);
        adam_second.assign(kHidden * kHidden + kPadding, 1.0f);
        copy_from = HugeArray<float>(kCopyFloats, 1.0f);
        copy_to = HugeArray<float>(kCopyFloats);
    }

    static constexpr std::size_t kCopyFloats = std::size_t{16} << 20;
    static constexpr std::size_t kNearFloats = 2048;  // copied inside the nearest cache
    static constexpr int kContributions = 400;

    const int channels;
    VoxelField field;
    Occupancy occupancy;
    Bricks bricks;
    std::vector<Tile> tiles;
    double n_samples = 0;
    std::vector<SampleGradient> sample_gradients;
    std::vector<LeafContribution> contributions;
    std::vector<float> ray_gradient, leaf_density, leaf_features, gradient, feature_gradient, moment,
        feature_moment;
    LeafMask touched{}, active{};
    std::vector<float> layer_in, layer_out, layer_gradient, weights, bias, weight_gradient, bias_gradient,
        adam_first, adam_second;
    HugeArray<float> copy_from, copy_to;

    /// Every ray to its end, leaf by leaf, or until there are as many samples as a tile has room for.
    void marchTile(const KernelSet& kernels, Tile& tile) const {
        std::fill(tile.next.begin(), tile.next.end(), 0);
        std::iota(tile.alive.begin(), tile.alive.end(), 0);
        tile.n = 0;
        for (int n_alive = kTileRays; n_alive > 0 && tile.n + n_alive * kStepsPerRound <= kMostSamples;) {
            const SampleArrays all = tile.samples();
            const int n = kernels.march(bricks, tile.rays(), kStep, kStepsPerRound, tile.alive.data(), n_alive,
                                        tile.begin.data(),
                                        {all.leaf + tile.n, all.cell + tile.n, all.x + tile.n, all.y + tile.n,
                                         all.z + tile.n, all.t + tile.n});
            int n_left = 0;
            for (int a = 0; a < n_alive; ++a) {
                const std::int32_t r = tile.alive[a];
                std::fill(&tile.ray[tile.n + tile.begin[a]], &tile.ray[tile.n + tile.begin[a + 1]], r);
                if (tile.next[r] >= 0) tile.alive[n_left++] = r;
            }
            tile.n += n;
            n_alive = n_left;
        }
    }

private:
    void makeTiles(int n_tiles) {
        const int across = std::max(1, static_cast<int>(std::lround(std::sqrt(n_tiles))));
        const Vec3d middle = field.worldBox().center();
        const double size = field.worldBox().size().norm();
        const Camera camera = lookAt(middle + size * Vec3d(0.6, -0.7, 0.5), middle, Vec3d::UnitZ(), 0.6,
                                     across * kTileEdge, across * kTileEdge);
        for (int number = 0; number < n_tiles; ++number) {
            Tile tile;
            for (auto* array :
                 {&tile.ox, &tile.oy, &tile.oz, &tile.dx, &tile.dy, &tile.dz, &tile.length, &tile.offset})
                array->assign(kTileRays + kPadding, 0.0f);
            for (auto* array : {&tile.next, &tile.alive, &tile.begin})
                array->assign(kTileRays + 1 + kPadding, 0);
            constexpr std::size_t most = kMostSamples + kPadding;
            for (auto* array : {&tile.leaf, &tile.cell, &tile.ray}) array->assign(most, 0);
            for (auto* array : {&tile.x, &tile.y, &tile.z, &tile.t, &tile.raw, &tile.tau, &tile.alpha,
                                &tile.decay, &tile.dots})
                array->assign(most, 0.0f);
            tile.features.assign(most * channels, 0.0f);
            tile.ray_features = noises(7, static_cast<std::size_t>(kTileRays) * channels);
            for (int r = 0; r < kTileRays; ++r) {
                const int px = number % across * kTileEdge + r % kTileEdge;
                const int py = number / across % across * kTileEdge + r / kTileEdge;
                addRay(tile, r, cameraRay(camera, px + 0.5, py + 0.5));
            }
            marchTile(kReference, tile);
            n_samples += tile.n;
            tiles.push_back(std::move(tile));
        }
    }

    /// From the box's front face, as the tracer starts its rays; a ray that misses has no length.
    void addRay(Tile& tile, int r, const Ray& ray) const {
        const Vec3d origin = field.frame().indexFromWorld(ray.origin);
        const Vec3d last = (field.topology().dims() - Vec3i::Ones()).cast<double>();
        double enter = 0, leave = 1e30;
        for (int axis = 0; axis < 3; ++axis) {
            const double a = -origin[axis] / ray.direction[axis],
                         b = (last[axis] - origin[axis]) / ray.direction[axis];
            enter = std::max(enter, std::min(a, b)), leave = std::min(leave, std::max(a, b));
        }
        const Vec3d entry = origin + ray.direction * (leave > enter ? enter : 0.0);
        tile.ox[r] = static_cast<float>(entry.x()), tile.dx[r] = static_cast<float>(ray.direction.x());
        tile.oy[r] = static_cast<float>(entry.y()), tile.dy[r] = static_cast<float>(ray.direction.y());
        tile.oz[r] = static_cast<float>(entry.z()), tile.dz[r] = static_cast<float>(ray.direction.z());
        tile.length[r] = leave > enter ? static_cast<float>(leave - enter) : 0.0f;
        tile.offset[r] = 0.5f * kStep;
    }

    /// One leaf that many samples reach into, and what its optimiser step needs.
    void makeLeaf() {
        ray_gradient = noises(8, static_cast<std::size_t>(kContributions) * channels);
        for (int i = 0; i < kContributions; ++i) {
            const auto fraction = [&](int axis) { return 0.5f + 0.5f * noise(10 + axis, i); };
            sample_gradients.push_back({static_cast<std::int32_t>(randomBits(9, 0, i) % kLeafVoxels), fraction(0),
                                        fraction(1), fraction(2), fraction(3), noise(14, i), &ray_gradient[i * channels]});
        }
        for (const SampleGradient& sample : sample_gradients) contributions.push_back({&sample, 0, 0});
        contributions.resize(kContributions + kPadding);
        active.fill(~std::uint64_t{0});
        leaf_density = noises(15, kLeafVoxels);
        leaf_features = noises(16, static_cast<std::size_t>(kLeafVoxels) * channels);
        gradient.assign(kLeafVoxels + kPadding, 0.0f);
        feature_gradient.assign(static_cast<std::size_t>(kLeafVoxels) * channels + kPadding, 0.0f);
        moment.assign(kLeafVoxels + kPadding, 1.0f);
        feature_moment.assign(kLeafVoxels + kPadding, 1.0f);
    }
};

constexpr const char* kMultiplyAdd = "multiply-add, an operation";
constexpr const char* kNearCopy = "copy in the nearest cache, a float";

/// A kernel as it is measured.
struct Kernel {
    std::string label;                            // with what an item is, unless it is a sample
    double items = 0, bytes = 0, operations = 0;  // items a call; bytes and operations an item
    std::function<void()> run;
};

std::vector<Kernel> kernelsOf(KernelData& data, const KernelSet& set) {
    const double c = data.channels, samples = std::max(data.n_samples, 1.0);
    const double lerps = 21;  // trilinear, one value: seven interpolations of three operations
    const auto perTile = [&data](auto body) {
        return [&data, body] {
            for (Tile& tile : data.tiles) body(tile);
        };
    };
    std::vector<Kernel> kernels;
    kernels.push_back(
        {"marchRays", samples, 24 + 12, 12, perTile([&data, set](Tile& tile) { data.marchTile(set, tile); })});
    kernels.push_back(
        {"densityForward", samples, 8 * 4 + 20 + 16, lerps + 3 * kExp, perTile([&data, set](Tile& tile) {
             set.density(data.bricks, tile.n, tile.samples(), kMaxRaw, 0.1f, tile.raw.data(), tile.tau.data(),
                         tile.alpha.data(), tile.decay.data());
         })});
    kernels.push_back({"featuresForward", samples, 8 * 4 * c + 28 + 12 * c, 18 + 16 * c + 2 * c,
                       perTile([&data, set](Tile& tile) {
                           set.features(data.bricks, tile.n, tile.samples(), tile.ray.data(), tile.alpha.data(),
                                        tile.features.data(), tile.ray_features.data());
                       })});
    kernels.push_back({"rowDots", samples, 8 * c + 8, 2 * c, perTile([&data, set](Tile& tile) {
                           set.dots(tile.n, data.channels, tile.features.data(), tile.ray.data(),
                                    tile.ray_features.data(), tile.dots.data());
                       })});
    kernels.push_back({"accumulateLeaf", KernelData::kContributions, 16 + 32 + 4 * c + 8 * 8 * (1 + c),
                       8 * (2 + 2 * c), [&data, set] {
                           set.accumulate(
                               KernelData::kContributions, data.contributions.data(), data.channels,
                               {data.gradient.data(), data.feature_gradient.data(), data.touched.data()});
                           std::fill(data.gradient.begin(), data.gradient.end(), 0.0f);
                           std::fill(data.feature_gradient.begin(), data.feature_gradient.end(), 0.0f);
                       }});
    // Rates of zero and moments that do not decay: the same work, again and again on the same numbers; values
    // that shrink would run into denormal numbers, which are slow.
    kernels.push_back({"rmsPropLeaf, a voxel", kLeafVoxels, 24 + 8 + 16 * c, 30 + 13 * c, [&data, set] {
                           data.touched.fill(~std::uint64_t{0});
                           set.optimise(
                               data.channels, {0, 0, 1.0f, 1e-4f, 0.01f, 0.03f, 0.2f}, data.active.data(),
                               {data.gradient.data(), data.feature_gradient.data(), data.touched.data()},
                               data.leaf_density.data(), data.moment.data(), data.leaf_features.data(),
                               data.feature_moment.data());
                       }});
    const double square = 2.0 * kHidden * kHidden, rows = 8.0 * kHidden;
    kernels.push_back({"layerForward, a ray", kTileRays, rows, square, [&data, set] {
                           set.layer(kTileRays, kTileRays, kHidden, kHidden, data.weights.data(),
                                     data.bias.data(), true, data.layer_in.data(), data.layer_out.data());
                       }});
    kernels.push_back({"layerBackwardInput, a ray", kTileRays, rows, square, [&data, set] {
                           set.layer_input(kTileRays, kTileRays, kHidden, kHidden, data.weights.data(),
                                           data.layer_gradient.data(), data.layer_in.data(),
                                           data.layer_out.data());
                       }});
    kernels.push_back({"layerBackwardWeights, a ray", kTileRays, rows, square, [&data, set] {
                           std::fill(data.weight_gradient.begin(), data.weight_gradient.end(), 0.0f);
                           std::fill(data.bias_gradient.begin(), data.bias_gradient.end(), 0.0f);
                           set.layer_weights(kTileRays, kTileRays, kHidden, kHidden, data.layer_gradient.data(),
                                             data.layer_in.data(), data.weight_gradient.data(),
                                             data.bias_gradient.data());
                       }});
    // A rate of zero, and moments that stay as they are.
    kernels.push_back({"adamStep, a parameter", kHidden * kHidden, 28, 12, [&data, set] {
                           set.adam(kHidden * kHidden, {1, 1, 1e-8f, 0, 1, 1}, data.weight_gradient.data(),
                                    data.adam_first.data(), data.adam_second.data(), data.weights.data());
                       }});
    return kernels;
}

/// The last column: how many times longer a kernel takes than its operations in registers, or its bytes in the nearest
/// cache, would. No floor for the scalar reference, and none for the yardsticks themselves.
void addFloors(const std::vector<Kernel>& kernels, BenchResult& result) {
    const auto nsOf = [&](const std::string& series, const std::string& label) {
        for (const BenchRow& row : result.rows)
            if (row.label == label && (series.empty() || row.series == series)) return result.median(row, "ns_per_item");
        return 0.0;
    };
    const double ns_per_byte = nsOf("", kNearCopy) / 8;
    for (std::size_t k = 0; k < kernels.size(); ++k) {
        BenchRow& row = result.rows[k];
        const double ns_per_operation = nsOf(row.series, kMultiplyAdd);
        if (ns_per_operation == 0 || row.label == kMultiplyAdd) continue;
        const double floor = std::max(kernels[k].operations * ns_per_operation, kernels[k].bytes * ns_per_byte);
        for (const double ns : row.cells[0]) row.cells[3].push_back(ns / floor);
    }
}

}  // namespace

BenchResult benchKernels(const KernelOptions& options, Report& report) {
    BenchResult result;
    result.kind = "kernels";
    result.title = "Kernels, one thread, " + std::to_string(options.channels) + " channels";
    result.facts = gatherFacts();
    result.facts.threads = 1;
    result.columns = {{"ns_per_item", "ns", Better::lower, Noise::timed, 0.03, 0},
                      {"gb_per_s", "GB/s", Better::neither, Noise::timed},
                      {"gflop_per_s", "GFLOP/s", Better::neither, Noise::timed},
                      {"times_floor", "", Better::neither, Noise::noisy}};

    // Instruction sets in turn, too: `bodies` holds every kernel of every set.
    KernelData data(options);
    std::vector<std::string> names = simd::supportedTargets();
    std::vector<Kernel> kernels;
    std::vector<std::string> series;
    const simd::KeepTarget restore;
    std::vector<float> end(kPadding);
    for (const std::string& target : names) {
        std::vector<Kernel> of_target = kernelsOf(data, kSimd);
        simd::forceTarget(target);
        of_target.push_back({kMultiplyAdd, simd::multiplyAdds(kYardstickRounds, 0, end.data()), 0, 1,
                             [&end] { simd::multiplyAdds(kYardstickRounds, 0, end.data()); }});
        for (Kernel& kernel : of_target) {
            kernel.run = [target, run = kernel.run] {
                if (simd::activeTarget() != target) simd::forceTarget(target);
                run();
            };
            kernels.push_back(std::move(kernel));
            series.push_back(target);
        }
    }
    for (Kernel& kernel : kernelsOf(data, kReference)) {
        kernels.push_back(std::move(kernel));
        series.push_back("scalar reference");
    }
    for (const auto& [label, n] : {std::pair{"copy, a float", KernelData::kCopyFloats},
                                   std::pair{kNearCopy, KernelData::kNearFloats}}) {
        kernels.push_back({label, static_cast<double>(n), 8, 0, [&data, n = n] {
                               std::memcpy(data.copy_to.data(), data.copy_from.data(), n * sizeof(float));
                           }});
        series.push_back("memory");
    }

    std::vector<std::function<void()>> bodies;
    for (const Kernel& kernel : kernels) bodies.push_back(kernel.run);
    const std::vector<Timing> timings = timeInTurn(
        bodies, {.repeats = options.repeats, .min_sample_s = options.min_sample_s}, "kernels", report);
    for (std::size_t k = 0; k < kernels.size(); ++k) {
        BenchRow row{series[k], kernels[k].label, std::vector<std::vector<double>>(4)};
        // Processor time: one thread, so it is the wall's on a quiet machine and still right on a shared one.
        for (const double seconds : timings[k].cpu_s) {
            const double per_item = seconds / kernels[k].items;
            row.cells[0].push_back(1e9 * per_item);
            row.cells[1].push_back(1e-9 * kernels[k].bytes / per_item);
            if (kernels[k].operations > 0) row.cells[2].push_back(1e-9 * kernels[k].operations / per_item);
        }
        result.rows.push_back(std::move(row));
    }
    addFloors(kernels, result);
    result.notes.push_back("bytes and operations are nominal (bench/kernel_rates.h); an item is a sample unless named");
    result.notes.push_back("floor: its operations at the rate of \"" + std::string(kMultiplyAdd) +
                           "\" on the same instruction set, or its bytes at that of \"" + kNearCopy +
                           "\", whichever takes longer");
    return result;
}

Plot kernelPlot(const BenchResult& result) {
    Plot plot = plotByLabel(result, "ns_per_item");
    plot.x.label = "nanoseconds an item (a sample, unless named)";
    plot.x.is_log = true;
    return plot;
}

}  // namespace nerfvdb
