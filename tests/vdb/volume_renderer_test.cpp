// SPDX-License-Identifier: Apache-2.0
#include "vdb/volume_renderer.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "core/image.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/random_volume.h"

using namespace nerfvdb;

namespace {

/// Value of a volume anywhere: trilinear between voxels, zero beyond. channel -1: sigma.
double valueAt(const Volume& volume, const Vec3d& world, int channel) {
    const Vec3d at = volume.frame().indexFromWorld(world);
    const Vec3d low = at.array().floor();
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3i step(corner >> 2 & 1, corner >> 1 & 1, corner & 1);
        const Vec3i voxel = low.cast<int>() + step;
        if ((voxel.array() < 0).any() || (voxel.array() >= volume.topology().dims().array()).any()) continue;
        const int leaf = volume.topology().findLeaf(voxel / kLeafDim);
        if (leaf < 0) continue;
        const std::size_t i = static_cast<std::size_t>(leaf) * kLeafVoxels +
                              brickOffset(voxel.x() & 7, voxel.y() & 7, voxel.z() & 7);
        double weight = 1;
        for (int axis = 0; axis < 3; ++axis) {
            const double u = at[axis] - low[axis];
            weight *= step[axis] ? u : 1 - u;
        }
        sum += weight * (channel < 0 ? volume.sigma()[i] : volume.color()[i * Volume::kChannels + channel]);
    }
    return sum;
}

/// The slow truth: a march in tiny steps through all of space, in double.
Vec3d marched(const Volume& volume, const Ray& ray, const Vec3f& background, double& opacity) {
    const double step = volume.frame().voxel_size / 100;
    double transmittance = 1;
    Vec3d light = Vec3d::Zero();
    for (double t = 0.5 * step; t < 12; t += step) {
        const Vec3d at = ray.origin + t * ray.direction;
        const double sigma = valueAt(volume, at, -1);
        if (sigma == 0) continue;
        const double decay = std::exp(-sigma * step);
        for (int c = 0; c < 3; ++c) light[c] += transmittance * (1 - decay) * valueAt(volume, at, c);
        transmittance *= decay;
    }
    opacity = 1 - transmittance;
    Vec3d srgb;
    for (int c = 0; c < 3; ++c)
        srgb[c] = displayValue(static_cast<float>(light[c] + transmittance * linearFromSrgb(background[c])));
    return srgb;
}

}  // namespace

TEST_CASE("pictures of a volume agree with a march in tiny steps: light adds up, then becomes sRGB") {
    const Volume volume = test::randomVolume(0.1, 8.0f);
    VolumeRenderOptions options;
    options.step_voxels = 0.05f;
    options.background = Vec3f(0.9f, 0.3f, 0.6f);
    const VolumeRenderer renderer(volume, options);
    const Vec3d centre(0.5, -0.5, 3.2);
    for (const Vec3d& eye : {Vec3d(4, 3, 5), Vec3d(0.6, -0.45, 3.1)}) {  // from outside, and from the inside
        const Camera camera = lookAt(eye, centre + Vec3d(0.01, 0.02, 0.03), Vec3d::UnitZ(), 0.9, 6, 5);
        const RenderedImage picture = renderer.render(camera);
        for (int y = 0; y < 5; ++y)
            for (int x = 0; x < 6; ++x) {
                double opacity = 0;
                const Vec3d truth = marched(volume, cameraRay(camera, x + 0.5, y + 0.5), options.background, opacity);
                // A twentieth of a voxel: quadrature of second order, and rays end at 1e-4.
                CHECK(*picture.opacity.at(x, y) == Approx(opacity).margin(1e-3));
                for (int c = 0; c < 3; ++c) CHECK(picture.rgb.at(x, y)[c] == Approx(truth[c]).margin(3e-3));
            }
    }
}

TEST_CASE("depth and normals of a turned volume are those of its density, in world axes") {
    // sigma rises along one axis, from nothing to opaque: all light comes from where it does.
    std::vector<Topology::LeafCells> active;
    LeafMask all;
    all.fill(~std::uint64_t{0});
    for (int x = 0; x < 3; ++x)
        for (int y = 0; y < 3; ++y)
            for (int z = 0; z < 3; ++z) active.push_back({{x, y, z}, all});
    Similarity turned;
    turned.scale = 2;
    turned.rotation = Eigen::AngleAxisd(0.9, Vec3d(1, 2, -2).normalized()).toRotationMatrix();
    turned.translation = Vec3d(5, 0, -1);
    for (const bool is_turned : {false, true}) {
        Volume volume(active, {Vec3d::Constant(-1.15), 0.1});  // centre at the world's origin
        for (std::size_t leaf = 0; leaf < volume.topology().leafCount(); ++leaf)
            forEachBit(volume.active()[leaf], [&](int offset) {
                const Vec3i at = test::givenVoxel(volume, leaf, offset);
                volume.sigma()[leaf * kLeafVoxels + offset] = static_cast<float>(200 * std::max(at.x() - 4, 0));
            });
        const Similarity placement = is_turned ? turned : Similarity{};
        volume.place(placement);
        // Looks along the slope, from 4 units before the voxel where it begins.
        const double first = -1.15 + 0.4;
        const Camera camera =
            placement.apply(lookAt(Vec3d(first - 4, 0.01, 0.02), Vec3d(0, 0.01, 0.02), Vec3d::UnitZ(), 0.02, 5, 5));
        VolumeRenderOptions options;
        options.normals = true;
        options.step_voxels = 0.05f;
        const RenderedImage picture = VolumeRenderer(volume, options).render(camera);
        // sigma = 2000 s at s units behind the beginning: exp(-1000 s^2) of the light is left, whose mean s is
        // sqrt(pi / 1000) / 2.
        const double depth = 4 + std::sqrt(std::numbers::pi / 1000) / 2;
        const Vec3d normal = placement.rotation * -Vec3d::UnitX();
        for (int i = 0; i < 25; ++i) {
            CHECK(picture.opacity.pixels[i] == Approx(1).margin(1e-4));
            CHECK(picture.depth.pixels[i] == Approx(placement.scale * depth).margin(placement.scale * 1e-3));
            for (int axis = 0; axis < 3; ++axis)
                CHECK(picture.normal.pixels[3 * i + axis] == Approx(normal[axis]).margin(1e-4));
        }
    }
}

TEST_CASE("pictures of a volume are the same bits on 1, 2 and 4 threads") {
    const Volume volume = test::randomVolume();
    const Camera camera = lookAt(Vec3d(4, 3, 5), Vec3d(0.5, -0.5, 3.2), Vec3d::UnitZ(), 0.8, 70, 50);
    VolumeRenderOptions options;
    options.normals = true;
    const auto rendered = [&](int threads) {
        const ThreadLimit limit(threads);
        return VolumeRenderer(volume, options).render(camera);
    };
    const RenderedImage one = rendered(1);
    for (const int threads : {2, 4}) {
        const RenderedImage many = rendered(threads);
        CHECK(many.rgb.pixels == one.rgb.pixels);
        CHECK(many.depth.pixels == one.depth.pixels);
        CHECK(many.normal.pixels == one.normal.pixels);
    }
}

TEST_CASE("a volume's light beyond white is clipped after it was added up, not before") {
    // Emission of 4 behind an opacity of one eighth: half of white, where a clipped colour would give an eighth.
    std::vector<Topology::LeafCells> active{{Vec3i::Zero(), {}}};
    active[0].cells.fill(~std::uint64_t{0});
    Volume volume(active, {Vec3d::Constant(-3.5), 1});
    for (std::size_t leaf = 0; leaf < volume.topology().leafCount(); ++leaf)
        forEachBit(volume.topology().voxels()[leaf], [&](int offset) {
            const std::size_t i = leaf * kLeafVoxels + offset;
            // Trilinear to zero beyond both faces: eight voxels' worth along any axis.
            if (testBit(volume.active()[leaf], offset)) volume.sigma()[i] = static_cast<float>(-std::log(0.875) / 8);
            for (int c = 0; c < 3; ++c) volume.color()[i * Volume::kChannels + c] = 4;
        });
    VolumeRenderOptions options;
    options.background = Vec3f::Zero();
    const RenderedImage picture =
        VolumeRenderer(volume, options).render(lookAt(Vec3d(9, 0, 0), Vec3d::Zero(), Vec3d::UnitZ(), 0.01, 3, 3));
    CHECK(*picture.opacity.at(1, 1) == Approx(0.125).margin(1e-4));
    for (int c = 0; c < 3; ++c) CHECK(picture.rgb.at(1, 1)[c] == Approx(srgbFromLinear(0.5f)).margin(1e-3));
}

TEST_CASE("nothing shows the background, exactly") {
    const Volume nothing(std::span<const Topology::LeafCells>{}, {});
    VolumeRenderOptions options;
    options.background = Vec3f(0.25f, 0.5f, 1.0f);
    const RenderedImage picture =
        VolumeRenderer(nothing, options).render(lookAt(Vec3d(3, 0, 0), Vec3d::Zero(), Vec3d::UnitZ(), 0.5, 8, 8));
    for (std::size_t i = 0; i < picture.opacity.pixels.size(); ++i) {
        CHECK(picture.opacity.pixels[i] == 0);
        for (int c = 0; c < 3; ++c) CHECK(picture.rgb.pixels[3 * i + c] == Approx(options.background[c]).margin(1e-6));
    }
}

TEST_CASE("values for the display are sRGB, clipped") {
    CHECK(displayValue(-1) == 0);
    CHECK(displayValue(0) == 0);
    CHECK(displayValue(1) == Approx(1));
    CHECK(displayValue(7) == Approx(1));
    CHECK(displayValue(0.214f) == Approx(0.5).margin(1e-3));
}
