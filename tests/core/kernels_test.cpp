// SPDX-License-Identifier: Apache-2.0
// Fast kernels against the scalar truth, on every instruction set, at every remainder of a vector's length.
// Marching has its own file: march_rays_test.cpp.
#include "core/simd/kernels.h"

#include <cmath>
#include <set>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/random_field.h"
#include "tests/support/targets.h"
#include "vdb/occupancy.h"

using namespace nerfvdb;
using test::forEachTarget;
using test::randomIn;

namespace {

constexpr double kTolerance = 1e-5;  // kernels.h: relative to the sum of the magnitudes of a sum's terms

std::vector<float> randomFloats(std::size_t n, float low, float high, std::uint64_t seed) {
    std::vector<float> values(n);
    for (std::size_t i = 0; i < n; ++i) values[i] = randomIn(low, high, seed, i);
    return values;
}

/// Number of entries that differ by more than kTolerance * magnitude.
int countWrong(const std::vector<float>& found, const std::vector<float>& expected, std::size_t n,
               double magnitude) {
    int wrong = 0;
    for (std::size_t i = 0; i < n; ++i)
        wrong += !(std::abs(static_cast<double>(found[i]) - expected[i]) <= kTolerance * magnitude);
    return wrong;
}

/// Random points in random cells of a field, as the kernels read them.
struct RandomSamples {
    std::vector<std::int32_t> leaf, cell, ray;
    std::vector<float> x, y, z, t, weight;

    RandomSamples(const Topology& topology, int n, int n_rays, std::uint64_t seed) {
        const std::size_t size = static_cast<std::size_t>(n) + kPadding;
        // What stands in the padding must not matter, but the kernels may touch it.
        for (auto* array : {&leaf, &cell, &ray}) array->assign(size, 0x7fffff);
        for (auto* array : {&x, &y, &z, &t, &weight}) array->assign(size, 1e30f);
        for (int i = 0; i < n; ++i) {
            std::vector<int> cells;
            leaf[i] = static_cast<std::int32_t>(randomBits(seed, 0, i) % topology.leafCount());
            forEachBit(topology.cells()[leaf[i]], [&](int offset) { cells.push_back(offset); });
            if (cells.empty()) {  // a leaf of upper corners only: one of the first leaf's cells instead
                leaf[i] = 0;
                forEachBit(topology.cells()[0], [&](int offset) { cells.push_back(offset); });
            }
            cell[i] = cells[randomBits(seed, 1, i) % cells.size()];
            ray[i] = static_cast<std::int32_t>(randomBits(seed, 2, i) % n_rays);
            x[i] = randomIn(0, 1, seed + 3, i), y[i] = randomIn(0, 1, seed + 4, i);
            z[i] = i % 5 == 0 ? 1.0f : randomIn(0, 1, seed + 5, i);  // upper faces included
            weight[i] = randomIn(0, 1, seed + 6, i);
        }
    }
    SampleArrays arrays() { return {leaf.data(), cell.data(), x.data(), y.data(), z.data(), t.data()}; }
};

Occupancy allCells(const VoxelField& field) {
    return occupancyFromCells(field.topology(),
                              {field.topology().cells().begin(), field.topology().cells().end()});
}

}  // namespace

TEST_CASE("a forced instruction set is the one that runs; another name changes nothing") {
    const std::vector<std::string> targets = simd::supportedTargets();
    REQUIRE(!targets.empty());
    CHECK(std::set<std::string>(targets.begin(), targets.end()).size() == targets.size());
    CHECK(simd::activeTarget() == targets.front());
    for (const std::string& target : targets) {
        REQUIRE(simd::forceTarget(target));
        CHECK(simd::activeTarget() == target);
        CHECK(simd::supportedTargets() == targets);
        CHECK_FALSE(simd::forceTarget("abacus"));
        CHECK(simd::activeTarget() == target);
    }
    REQUIRE(simd::forceTarget({}));
    CHECK(simd::activeTarget() == targets.front());
}

TEST_CASE("density of samples: fast = reference") {
    // Raw values from nothing (tau 1e-13) to far above the clamp (tau 3e6): both ends of exp.
    const VoxelField field = test::randomField(Vec3i(24, 16, 16), 4, 0.4, -30.0f, 30.0f, 1);
    const Occupancy occupancy = allCells(field);
    const Bricks bricks = bricksOf(field, occupancy);
    forEachTarget([&] {
        for (int n = 0; n <= 2 * kPadding + 1; ++n) {
            RandomSamples samples(field.topology(), n, 1, 10 + n);
            std::vector<float> fast[4], slow[4];
            for (int k = 0; k < 4; ++k) fast[k].resize(n + kPadding), slow[k].resize(n + kPadding);
            simd::densityForward(bricks, n, samples.arrays(), 15.0f, 0.9f, fast[0].data(), fast[1].data(),
                                 fast[2].data(), fast[3].data());
            reference::densityForward(bricks, n, samples.arrays(), 15.0f, 0.9f, slow[0].data(), slow[1].data(),
                                      slow[2].data(), slow[3].data());
            int wrong = 0;
            for (int i = 0; i < n; ++i) {
                // Terms of the trilinear sum reach 30; exp turns that into a relative error of tau and alpha,
                // and into an absolute one of decay (tau exp(-tau) < 0.4).
                const double error = 30 * kTolerance;
                const double tau = slow[1][i];
                wrong += !(std::abs(fast[0][i] - slow[0][i]) <= error);
                wrong += !(std::abs(fast[1][i] - tau) <= error * tau);
                wrong += !(std::abs(fast[2][i] - slow[2][i]) <= error * slow[2][i]);
                wrong += !(std::abs(fast[3][i] - slow[3][i]) <= 0.4 * error);
                wrong += !(std::abs(fast[2][i] + fast[3][i] - 1) <= 2e-7);  // 1 ulp each of alpha and decay
            }
            CHECK(wrong == 0);
        }
    });
}

TEST_CASE("sigma of samples: fast = reference") {
    // From nothing to an optical depth of 900 a sample.
    const VoxelField field = test::randomField(Vec3i(24, 16, 16), 4, 0.4, 0.0f, 1000.0f, 1);
    const Occupancy occupancy = allCells(field);
    const Bricks bricks = bricksOf(field, occupancy);
    forEachTarget([&] {
        for (const float tau_scale : {1e-6f, 1e-3f, 0.9f})
            for (int n = 0; n <= 2 * kPadding + 1; ++n) {
                RandomSamples samples(field.topology(), n, 1, 10 + n);
                std::vector<float> fast[3], slow[3];
                for (int k = 0; k < 3; ++k) fast[k].resize(n + kPadding), slow[k].resize(n + kPadding);
                simd::sigmaForward(bricks, n, samples.arrays(), tau_scale, fast[0].data(), fast[1].data(),
                                   fast[2].data());
                reference::sigmaForward(bricks, n, samples.arrays(), tau_scale, slow[0].data(), slow[1].data(),
                                        slow[2].data());
                int wrong = 0;
                for (int i = 0; i < n; ++i) {
                    // All terms of the sum are positive, so its relative error is that of each.
                    wrong += !(std::abs(fast[0][i] - slow[0][i]) <= kTolerance * slow[0][i]);
                    wrong += !(std::abs(fast[1][i] - slow[1][i]) <= kTolerance * slow[1][i]);
                    wrong += !(std::abs(fast[2][i] - slow[2][i]) <= 0.4 * kTolerance);  // tau exp(-tau) < 0.4
                }
                CHECK(wrong == 0);
            }
    });
}

TEST_CASE("features of samples, summed along rays: fast = reference for 4, 8 and 16 channels") {
    constexpr int kRays = 3;
    for (const int channels : {4, 8, 16}) {
        CAPTURE(channels);
        const VoxelField field = test::randomField(Vec3i(24, 16, 16), channels, 0.4, -1.0f, 1.0f, 2);
        const Occupancy occupancy = allCells(field);
        const Bricks bricks = bricksOf(field, occupancy);
        forEachTarget([&] {
            for (int n = 0; n <= 2 * kPadding + 1; ++n) {
                RandomSamples samples(field.topology(), n, kRays, 20 + n);
                const std::size_t n_values = static_cast<std::size_t>(n) * channels;
                std::vector<float> fast(n_values + kPadding), slow(n_values + kPadding);
                std::vector<float> fast_sum = randomFloats(kRays * channels + kPadding, -1, 1, 30),
                                   slow_sum = fast_sum;
                simd::featuresForward(bricks, n, samples.arrays(), samples.ray.data(), samples.weight.data(),
                                      fast.data(), fast_sum.data());
                reference::featuresForward(bricks, n, samples.arrays(), samples.ray.data(),
                                           samples.weight.data(), slow.data(), slow_sum.data());
                CHECK(countWrong(fast, slow, n_values, 1.0) == 0);
                CHECK(countWrong(fast_sum, slow_sum, kRays * channels, 1.0 + n) == 0);

                std::vector<float> fast_dot(n + kPadding), slow_dot(n + kPadding);
                simd::rowDots(n, channels, slow.data(), samples.ray.data(), slow_sum.data(), fast_dot.data());
                reference::rowDots(n, channels, slow.data(), samples.ray.data(), slow_sum.data(),
                                   slow_dot.data());
                CHECK(countWrong(fast_dot, slow_dot, n, channels * (1.0 + n)) == 0);
            }
        });
    }
}

/// A cell, and by which of its corners (all, or those beyond a face) it reaches into a leaf.
struct LeafPlace {
    std::int32_t cell;
    std::uint32_t corner;
};

LeafPlace randomLeafPlace(std::uint64_t seed, std::uint64_t i) {
    LeafPlace place{0, 0};
    for (int axis = 0; axis < 3; ++axis) {
        const auto coordinate = static_cast<std::int32_t>(randomBits(seed, axis, i) % 9);
        const bool is_below = coordinate == 8;  // the cell is the last of the lower neighbour
        place.cell = place.cell * 8 + (is_below ? 7 : coordinate);
        place.corner = place.corner * 2 + (is_below ? 1 : 0);
    }
    return place;
}

TEST_CASE("gradients of one leaf: fast = reference, and the same voxels are touched") {
    for (const int channels : {4, 8, 16}) {
        CAPTURE(channels);
        constexpr int kSamples = 200;
        const std::vector<float> dl_dfeatures = randomFloats(kSamples * channels + kPadding, -1, 1, 40);
        std::vector<SampleGradient> samples;
        std::vector<LeafContribution> contributions;
        for (int i = 0; i < kSamples; ++i) {
            // Two or three after each other in one cell and of one ray, but some of another ray, some by other corners.
            LeafPlace place = randomLeafPlace(41, i / 3);
            const int ray = i % 5 == 1 ? i : i / 3;
            if (i % 7 == 2) place.corner = 0;
            samples.push_back({place.cell, randomIn(0, 1, 42, i), randomIn(0, 1, 43, i), randomIn(0, 1, 44, i),
                               randomIn(0, 1, 45, i), randomIn(-1, 1, 46, i), &dl_dfeatures[ray * channels]});
            contributions.push_back({nullptr, 0, place.corner});
        }
        for (int i = 0; i < kSamples; ++i) contributions[i].sample = &samples[i];
        contributions.resize(kSamples + kPadding);
        struct Sums {
            std::vector<float> density, features;
            LeafMask touched{};
            explicit Sums(int n) : density(512 + kPadding), features(512 * n + kPadding) {}
            LeafGradient view() { return {density.data(), features.data(), touched.data()}; }
        };
        Sums slow(channels);
        reference::accumulateLeaf(kSamples, contributions.data(), channels, slow.view());
        forEachTarget([&] {
            Sums fast(channels);
            simd::accumulateLeaf(kSamples, contributions.data(), channels, fast.view());
            // No voxel meets more than 20 of these samples with weights that sum to more than 4.
            CHECK(countWrong(fast.density, slow.density, 512, 4) == 0);
            CHECK(countWrong(fast.features, slow.features, 512 * channels, 4) == 0);
            CHECK(fast.touched == slow.touched);
        });
    }
}

TEST_CASE("RMSprop of one leaf: fast = reference; untouched voxels keep everything, gradients are cleared") {
    const auto smoothing = GENERATE(std::pair{0.4f, 0.5f}, std::pair{0.0f, 0.0f}, std::pair{0.4f, 0.0f}, std::pair{0.0f, 0.5f});
    const RmsPropRates rates{0.3f, 0.03f, 0.95f, 1e-4f, 0.02f, smoothing.first, smoothing.second};
    CAPTURE(rates.density_smoothing, rates.feature_smoothing);
    for (const int channels : {4, 8, 16}) {
        CAPTURE(channels);
        struct Leaf {
            std::vector<float> gradient, feature_gradient, density, moment, features, feature_moment;
            LeafMask touched, active;
            explicit Leaf(int n)
                : gradient(randomFloats(512 + kPadding, -1, 1, 50)),
                  feature_gradient(randomFloats(512 * n + kPadding, -1, 1, 51)),
                  density(randomFloats(512 + kPadding, -4, 4, 52)),
                  moment(randomFloats(512 + kPadding, 0, 1, 53)),
                  features(randomFloats(512 * n + kPadding, -1, 1, 54)),
                  feature_moment(randomFloats(512 + kPadding, 0, 1, 55)) {
                for (int word = 0; word < 8; ++word) {
                    touched[word] = randomBits(56, 0, word) & randomBits(56, 1, word);
                    active[word] = touched[word] | randomBits(56, 2, word);
                }
            }
            void step(int n, const RmsPropRates& rates, decltype(&simd::rmsPropLeaf) kernel) {
                kernel(n, rates, active.data(), {gradient.data(), feature_gradient.data(), touched.data()}, density.data(),
                       moment.data(), features.data(), feature_moment.data());
            }
        };
        const Leaf before(channels);
        Leaf slow(channels);
        slow.step(channels, rates, &reference::rmsPropLeaf);
        forEachTarget([&] {
            Leaf fast(channels);
            fast.step(channels, rates, &simd::rmsPropLeaf);
            CHECK(countWrong(fast.density, slow.density, 512, 4) == 0);
            CHECK(countWrong(fast.moment, slow.moment, 512, 1) == 0);
            CHECK(countWrong(fast.features, slow.features, 512 * channels, 1) == 0);
            CHECK(countWrong(fast.feature_moment, slow.feature_moment, 512, 1) == 0);
            CHECK(fast.touched == LeafMask{});
            int wrong = 0;
            for (int voxel = 0; voxel < 512; ++voxel) {
                const bool is_touched = testBit(before.touched, voxel);
                wrong += is_touched == (fast.density[voxel] == before.density[voxel]);
                wrong += is_touched == (fast.feature_moment[voxel] == before.feature_moment[voxel]);
                wrong +=
                    is_touched && (fast.gradient[voxel] != 0 || fast.feature_gradient[voxel * channels] != 0);
            }
            CHECK(wrong == 0);
        });
    }
}

TEST_CASE("where samples say nothing, density sinks, and both move towards the neighbours that exist") {
    constexpr int kChannels = 4, kMiddle = 3 * 64 + 4 * 8 + 5, kCorner = 0, kPeak = 500;
    const RmsPropRates rates{0.5f, 0.25f, 0.9f, 1e-4f, 0.1f, 0.2f, 0.4f};
    test::forEachTarget([&] {
        std::vector<float> gradient(512), feature_gradient(512 * kChannels + kPadding), density(512, 2.0f),
            moment(512), features(512 * kChannels + kPadding, 1.0f), feature_moment(512);
        LeafMask touched{}, active{};
        for (const int voxel : {kCorner, kMiddle, kPeak}) setBit(touched, voxel);
        // Of the middle's six neighbours two exist, with values 5 and 2; the others' values must not matter.
        setBit(active, kMiddle - 64), setBit(active, kMiddle + 1);
        density[kMiddle - 64] = 2.9f, density[kMiddle + 1] = 1.5f, density[kMiddle + 8] = 100.0f;
        setBit(active, kPeak - 1), density[kPeak] = 9.0f;
        for (int c = 0; c < kChannels; ++c) {
            features[(kMiddle - 64) * kChannels + c] = 5.0f;
            features[(kMiddle + 1) * kChannels + c] = 2.0f;
            features[(kMiddle + 8) * kChannels + c] = 100.0f;
            features[1 * kChannels + c] = 100.0f;
        }
        simd::rmsPropLeaf(kChannels, rates, active.data(),
                          {gradient.data(), feature_gradient.data(), touched.data()}, density.data(),
                          moment.data(), features.data(), feature_moment.data());
        CHECK(density[kCorner] == Approx(2.0 - 0.5 * 0.1));
        CHECK(density[kMiddle] == Approx(2.0 - 0.5 * (0.1 + 0.2 * (2.0 - 2.2))));
        CHECK(density[kPeak] == Approx(9.0 - 0.5 * (0.1 + 0.2 * 1)));  // 7 above its neighbour, but pulled as by 1
        CHECK(density[kMiddle + 1] == 1.5f);
        for (int c = 0; c < kChannels; ++c) {
            CHECK(features[kMiddle * kChannels + c] == Approx(1.0 + 0.25 * 0.4 * (3.5 - 1.0)));
            CHECK(features[kCorner * kChannels + c] == 1.0f);  // no neighbour exists
        }
    });
}

TEST_CASE("network layers, forward and backward: fast = reference for all remainders of rows and samples") {
    for (const auto& layer : {std::pair{1, 1}, {3, 5}, {20, 64}, {64, 3}})
        for (const int n : {0, 1, 15, 16, 17, 31, 33, 64, 100, 130}) {
            const int n_in = layer.first, n_out = layer.second;
            CAPTURE(n_in, n_out, n);
            const int padded = (n + kPadding - 1) / kPadding * kPadding;
            const int stride = padded + kPadding;  // wider than the batch: what lies between must stay
            const auto rows = [&](int count, std::uint64_t seed) {
                return randomFloats(static_cast<std::size_t>(count) * stride + kPadding, -1, 1, seed);
            };
            const std::vector<float> weights = randomFloats(n_in * n_out + kPadding, -1, 1, 60);
            const std::vector<float> bias = randomFloats(n_out + kPadding, -1, 1, 61), in = rows(n_in, 62);
            std::vector<float> dl_dout = rows(n_out, 63);
            for (int o = 0; o < n_out; ++o)
                for (int b = n; b < padded; ++b) dl_dout[o * stride + b] = 0;

            for (const bool relu : {false, true}) {
                std::vector<float> out = rows(n_out, 64), dl_din = rows(n_in, 65);
                std::vector<float> dl_dweights = weights, dl_dbias = bias;  // sums are added to what is there
                reference::layerForward(n, stride, n_in, n_out, weights.data(), bias.data(), relu, in.data(),
                                        out.data());
                reference::layerBackwardInput(n, stride, n_in, n_out, weights.data(), dl_dout.data(),
                                              relu ? in.data() : nullptr, dl_din.data());
                reference::layerBackwardWeights(n, stride, n_in, n_out, dl_dout.data(), in.data(),
                                                dl_dweights.data(), dl_dbias.data());
                forEachTarget([&] {
                    std::vector<float> fast_out = rows(n_out, 64), fast_din = rows(n_in, 65);
                    std::vector<float> fast_dweights = weights, fast_dbias = bias;
                    simd::layerForward(n, stride, n_in, n_out, weights.data(), bias.data(), relu, in.data(),
                                       fast_out.data());
                    simd::layerBackwardInput(n, stride, n_in, n_out, weights.data(), dl_dout.data(),
                                             relu ? in.data() : nullptr, fast_din.data());
                    simd::layerBackwardWeights(n, stride, n_in, n_out, dl_dout.data(), in.data(),
                                               fast_dweights.data(), fast_dbias.data());
                    CHECK(countWrong(fast_out, out, out.size(), 1 + n_in) == 0);
                    CHECK(countWrong(fast_din, dl_din, dl_din.size(), n_out) == 0);
                    CHECK(countWrong(fast_dweights, dl_dweights, dl_dweights.size(), 1 + n) == 0);
                    CHECK(countWrong(fast_dbias, dl_dbias, dl_dbias.size(), 1 + n) == 0);
                });
            }
        }
}

TEST_CASE("Adam: fast = reference, for any number of parameters and nothing beyond them") {
    for (const int n : {1, 15, 16, 17, 100}) {
        const AdamRates rates{0.9f, 0.99f, 1e-8f, 3e-3f, 1 / (1 - 0.9f), 1 / (1 - 0.99f)};
        const std::vector<float> gradients = randomFloats(n + 1, -1, 1, 71);
        std::vector<float> first = randomFloats(n + 1, -1, 1, 72), second = randomFloats(n + 1, 0, 1, 73);
        std::vector<float> parameters = randomFloats(n + 1, -1, 1, 74);
        std::vector<float> slow_first = first, slow_second = second, slow_parameters = parameters;
        reference::adamStep(n, rates, gradients.data(), slow_first.data(), slow_second.data(), slow_parameters.data());
        CHECK(slow_parameters[0] != parameters[0]);
        CHECK(slow_parameters[n] == parameters[n]);
        forEachTarget([&] {
            std::vector<float> fast_first = first, fast_second = second, fast_parameters = parameters;
            simd::adamStep(n, rates, gradients.data(), fast_first.data(), fast_second.data(), fast_parameters.data());
            CHECK(countWrong(fast_first, slow_first, slow_first.size(), 2) == 0);
            CHECK(countWrong(fast_second, slow_second, slow_second.size(), 2) == 0);
            CHECK(countWrong(fast_parameters, slow_parameters, slow_parameters.size(), 2) == 0);
        });
    }
}

TEST_CASE("the yardstick multiplies and adds in every lane, and says how often") {
    std::vector<float> end(kPadding);
    CHECK(reference::multiplyAdds(3, 3.0f, end.data()) == 72);
    CHECK(end[0] == 12 * 1.25f);
    forEachTarget([&] {
        std::vector<float> fast(kPadding, -1.0f);
        const double lanes = simd::multiplyAdds(3, 3.0f, fast.data()) / 72;
        CHECK((lanes == 1 || lanes == 4 || lanes == 8 || lanes == 16));
        for (int i = 0; i < kPadding; ++i) CHECK(fast[static_cast<std::size_t>(i)] == (i < lanes ? end[0] : 0.0f));
    });
}
