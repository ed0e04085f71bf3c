// SPDX-License-Identifier: Apache-2.0
#include "vdb/volume_renderer.h"

#include <cmath>

#include "core/image.h"
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
