// SPDX-License-Identifier: Apache-2.0
#include "vdb/ray_tracer.h"

#include <algorithm>
#include <cmath>

#include "tests/support/catch.h"
#include "tests/support/random_field.h"
#include "tests/support/random_volume.h"
#include "vdb/leaf_scatter.h"

using namespace nerfvdb;

namespace {

constexpr int kChannels = 4;

/// Everything is read and nothing is dropped, so that the loss is a smooth function of the parameters.
TraceOptions exactOptions() {
    TraceOptions options;
    options.stop_transmittance = 0;
    options.min_weight = 0;
    return options;
}

Occupancy allCells(const VoxelField& field) {
    return occupancyFromCells(field.topology(), {field.topology().cells().begin(), field.topology().cells().end()});
}

void addRays(RayTracer& tracer, const TraceScene& scene, const Box& box, int n) {
    for (int r = 0; r < n; ++r) {
        Vec3d from, to;
        for (int axis = 0; axis < 3; ++axis) {
            from[axis] = box.center()[axis] + 3 * (test::randomIn(-1, 1, 5, r * 8 + axis) * box.size()[axis]);
            to[axis] = box.center()[axis] + 0.3 * (test::randomIn(-1, 1, 6, r * 8 + axis) * box.size()[axis]);
        }
        tracer.addRay(scene, {from, (to - from).normalized()}, 0.5f, test::randomIn(0, 1, 7, r));
    }
}

/// A linear loss of what tracing gives, with fixed random slopes.
struct LinearLoss {
    std::vector<float> dl_dray_features, dl_dtransmittance;
    explicit LinearLoss(int n_rays) {
        for (int i = 0; i < n_rays * kChannels; ++i) dl_dray_features.push_back(test::randomIn(-1, 1, 11, i));
        for (int i = 0; i < n_rays; ++i) dl_dtransmittance.push_back(test::randomIn(-1, 1, 12, i));
    }
    double operator()(RayTracer& tracer) const {
        double sum = 0;
        for (int i = 0; i < tracer.rayCount() * kChannels; ++i)
            sum += static_cast<double>(dl_dray_features[i]) * tracer.rayFeatures()[i];
        for (int r = 0; r < tracer.rayCount(); ++r)
            sum += static_cast<double>(dl_dtransmittance[r]) * tracer.transmittance()[r];
        return sum;
    }
};

}  // namespace

TEST_CASE("gradients of density and features agree with central differences through the whole tracer") {
    VoxelField field = test::randomField(Vec3i(16, 24, 16), kChannels, 0.7, -2.0f, 2.0f, 3);
    const Occupancy occupancy = allCells(field);
    const TraceScene scene(field, occupancy);
    constexpr int kRays = 40;
    const LinearLoss loss(kRays);
    RayTracer tracer(kRays);
    addRays(tracer, scene, field.worldBox(), kRays);

    std::vector<TileGradients> tiles(1);
    tracer.trace(scene, exactOptions(), tiles[0].kept);
    tiles[0].dl_dray_features = loss.dl_dray_features;
    tracer.traceBackward(scene, tiles[0].dl_dray_features.data(), loss.dl_dtransmittance.data(), /*dl_ddistortion=*/0,
                         tiles[0].kept);
    tiles[0].bin(field.topology(), kChannels);
    std::vector<float> dl_ddensity(field.density().size()), dl_dfeatures(field.features().size());
    LeafScatter scatter;
    scatter.run(field.topology(), kChannels, tiles,
                [&](std::int32_t leaf, const LeafGradient& gradient, const LeafMask&) {
                    for (int v = 0; v < kLeafVoxels; ++v) {
                        dl_ddensity[static_cast<std::size_t>(leaf) * kLeafVoxels + v] = gradient.density[v];
                        gradient.density[v] = 0;
                        for (int c = 0; c < kChannels; ++c) {
                            dl_dfeatures[(static_cast<std::size_t>(leaf) * kLeafVoxels + v) * kChannels + c] =
                                gradient.features[v * kChannels + c];
                            gradient.features[v * kChannels + c] = 0;
                        }
                    }
                    for (int word = 0; word < kLeafWords; ++word) gradient.touched[word] = 0;
                });

    const auto difference = [&](float& parameter, float h) {
        KeptSamples kept;
        const float before = parameter;
        parameter = before + h;
        tracer.trace(scene, exactOptions(), kept);
        const double up = loss(tracer);
        parameter = before - h;
        tracer.trace(scene, exactOptions(), kept);
        const double down = loss(tracer);
        parameter = before;
        return (up - down) / (2.0 * static_cast<double>(h));
    };
    double largest_density = 0, largest_feature = 0;
    for (const float g : dl_ddensity) largest_density = std::max(largest_density, std::abs(static_cast<double>(g)));
    for (const float g : dl_dfeatures) largest_feature = std::max(largest_feature, std::abs(static_cast<double>(g)));
    REQUIRE(largest_density > 0.01);

    // Single precision sums of ~40 rays carry about 1e-6 of the loss (order 10); over a step of 2 * 0.02 that is
    // 2e-4, and the curvature over 0.02 adds about 1e-4 of a slope: 1 % of the largest slope is safe and sharp.
    int n_checked = 0, n_wrong = 0;
    for (std::size_t i = 0; i < dl_ddensity.size(); i += 3) {
        if (std::abs(dl_ddensity[i]) < 0.02 * largest_density) continue;
        const double expected = difference(field.density()[i], 0.02f);
        n_wrong += std::abs(expected - dl_ddensity[i]) > 0.01 * largest_density;
        ++n_checked;
    }
    CHECK(n_checked > 40);
    CHECK(n_wrong == 0);
    n_checked = n_wrong = 0;
    for (std::size_t i = 0; i < dl_dfeatures.size(); i += 7) {
        if (std::abs(dl_dfeatures[i]) < 0.02 * largest_feature) continue;
        const double expected = difference(field.features()[i], 0.1f);
        n_wrong += std::abs(expected - dl_dfeatures[i]) > 0.01 * largest_feature;
        ++n_checked;
    }
    CHECK(n_checked > 40);
    CHECK(n_wrong == 0);
}

TEST_CASE("a volume's gradients of sigma and colour agree with central differences through the whole tracer") {
    Volume volume = test::randomVolume(0.1, 4.0f);
    const Occupancy occupancy = allCells(volume);
    const TraceScene scene(volume, occupancy);
    constexpr int kRays = 40;
    const LinearLoss loss(kRays);
    RayTracer tracer(kRays);
    const GridFrame& frame = volume.frame();
    addRays(tracer, scene, {frame.origin, frame.worldFromIndex(volume.topology().dims().cast<double>())}, kRays);

    KeptSamples kept;
    tracer.trace(scene, exactOptions(), kept);
    std::vector<float> dl_dray_features = loss.dl_dray_features;
    tracer.traceBackward(scene, dl_dray_features.data(), loss.dl_dtransmittance.data(), /*dl_ddistortion=*/0, kept);
    // The adjoint of the trilinear reads, said plainly.
    std::vector<double> dl_dsigma(volume.sigma().size()), dl_dcolor(volume.color().size());
    for (int i = 0; i < kept.n; ++i)
        for (int corner = 0; corner < 8; ++corner) {
            const double u[3] = {kept.x[i], kept.y[i], kept.z[i]};
            double weight = 1;
            for (int axis = 0; axis < 3; ++axis) weight *= corner >> (2 - axis) & 1 ? u[axis] : 1 - u[axis];
            const std::size_t voxel = cornerIndex(scene.bricks, kept.leaf[i], kept.cell[i], corner);
            dl_dsigma[voxel] += weight * kept.dl_draw[i];
            for (int c = 0; c < kChannels; ++c)
                dl_dcolor[voxel * kChannels + c] +=
                    weight * kept.weight[i] * dl_dray_features[kept.ray[i] * kChannels + c];
        }

    const auto difference = [&](float& parameter, float h) {
        KeptSamples ignored;
        const float before = parameter;
        parameter = before + h;
        tracer.trace(scene, exactOptions(), ignored);
        const double up = loss(tracer);
        parameter = before - h;
        tracer.trace(scene, exactOptions(), ignored);
        const double down = loss(tracer);
        const double step = static_cast<double>(before + h) - static_cast<double>(before - h);
        parameter = before;
        return (up - down) / step;
    };
    // Of the largest slope: the loss, of order 10, carries 1e-6 of rounding over a step of 0.1, and its curvature over
    // an optical depth of 0.1 * 0.1 of a voxel adds as little.
    const auto check = [&](std::span<float> parameters, const std::vector<double>& slopes, std::size_t stride) {
        double largest = 0;
        for (const double slope : slopes) largest = std::max(largest, std::abs(slope));
        int n_checked = 0, n_wrong = 0;
        for (std::size_t i = 0; i < slopes.size(); i += stride) {
            // Where nothing is, a step down would be light out of nothing, which tracing drops.
            if (std::abs(slopes[i]) < 0.05 * largest || parameters[i] == 0) continue;
            n_wrong += std::abs(difference(parameters[i], 0.05f) - slopes[i]) > 0.01 * largest;
            ++n_checked;
        }
        CHECK(n_checked > 40);
        CHECK(n_wrong == 0);
    };
    check(volume.sigma(), dl_dsigma, 2);
    check(volume.color(), dl_dcolor, 13);
}

TEST_CASE("weights and transmittance sum to one on every ray") {
    VoxelField field = test::randomField(Vec3i(24, 24, 24), kChannels, 0.5, -3.0f, 4.0f, 9);
    const Occupancy occupancy = allCells(field);
    const TraceScene scene(field, occupancy);
    RayTracer tracer(100);
    addRays(tracer, scene, field.worldBox(), 100);
    KeptSamples kept;
    tracer.trace(scene, exactOptions(), kept);
    std::vector<double> sum(100);
    for (int i = 0; i < kept.n; ++i) sum[kept.ray[i]] += kept.weight[i];
    for (int r = 0; r < 100; ++r)
        // About 100 samples a ray, each product rounded to 6e-8.
        CHECK(sum[r] + tracer.transmittance()[r] == Approx(1).margin(1e-5));
}

TEST_CASE("features along a ray are a mean: a surface has its colour however little of the light it stops") {
    VoxelField field = test::randomField(Vec3i(24, 24, 24), kChannels, 0.5, -12.0f, 0.0f, 9);
    for (std::size_t i = 0; i < field.features().size(); ++i) field.features()[i] = 0.25f * static_cast<float>(i % kChannels) - 0.3f;
    const Occupancy occupancy = allCells(field);
    const TraceScene scene(field, occupancy);
    RayTracer tracer(100);
    addRays(tracer, scene, field.worldBox(), 100);
    KeptSamples kept;
    for (const TraceOptions& options : {exactOptions(), TraceOptions{}}) {
        tracer.trace(scene, options, kept);
        std::vector<int> n_kept(100);
        for (int i = 0; i < kept.n; ++i) ++n_kept[kept.ray[i]];
        int n_faint = 0;
        for (int r = 0; r < 100; ++r) {
            n_faint += n_kept[r] > 0 && tracer.transmittance()[r] > 0.9f;
            // Some hundred terms, each rounded to 6e-8.
            for (int c = 0; c < kChannels; ++c)
                CHECK(tracer.rayFeatures()[r * kChannels + c] ==
                      Approx(n_kept[r] > 0 ? 0.25f * static_cast<float>(c) - 0.3f : 0.0f).margin(1e-5));
        }
        CHECK(n_faint > 5);
    }
}
