// SPDX-License-Identifier: Apache-2.0
// What Blender makes of files like the exported ones, held against a march along rays that is spelt out here. The
// program's own exports are shown to Blender in tests/cli.
#include <openvdb/tools/Interpolation.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>

#include "core/atomic_file.h"
#include "core/image.h"
#include "core/parallel.h"
#include "export/camera_export.h"
#include "export/placement.h"
#include "tests/support/catch.h"
#include "tests/support/data.h"
#include "tests/support/temp_dir.h"
#include "vdb/openvdb_grids.h"

using namespace nerfvdb;

namespace {

constexpr int kVoxels = 48;  // along an edge of the box [-1, 1]^3 that holds the ball
constexpr double kVoxel = 2.0 / kVoxels;

/// A ball with a soft rim and a hole through it, coloured by place; grids placed in another world.
struct ColouredBall {
    openvdb::FloatGrid::Ptr density = openvdb::FloatGrid::create(0.0f);
    openvdb::Vec3SGrid::Ptr color = openvdb::Vec3SGrid::create(openvdb::Vec3s(0.0f));

    explicit ColouredBall(const Similarity& placement) {
        for (int x = 0; x < kVoxels; ++x)
            for (int y = 0; y < kVoxels; ++y)
                for (int z = 0; z < kVoxels; ++z) {
                    const Vec3d p = Vec3d(x, y, z) * kVoxel - Vec3d::Constant(1);
                    const openvdb::Coord ijk(x, y, z);
                    const double rim = std::clamp((0.8 - p.norm()) / 0.1, 0.0, 1.0);
                    const double hole = std::clamp((std::hypot(p.x() - 0.2, p.z()) - 0.2) / 0.1, 0.0, 1.0);
                    if (rim * hole > 0)
                        density->tree().setValueOn(ijk, static_cast<float>(40 * rim * hole / placement.scale));
                    if (p.norm() < 0.9)
                        color->tree().setValueOn(ijk, {static_cast<float>(0.5 + 0.5 * std::sin(3 * p.x())),
                                                       static_cast<float>(0.5 + 0.5 * std::sin(4 * p.y() + 1)),
                                                       static_cast<float>(0.5 + 0.5 * std::cos(5 * p.z()))});
                }
        // OpenVDB multiplies row vectors from the left.
        openvdb::Mat4d world_from_index = openvdb::Mat4d::identity();
        const Mat3d linear = placement.scale * kVoxel * placement.rotation;
        const Vec3d first = placement.apply(Vec3d::Constant(-1));
        for (int row = 0; row < 3; ++row)
            for (int column = 0; column < 4; ++column)
                world_from_index(column, row) = column < 3 ? linear(row, column) : first[row];
        density->setName("density");
        density->setGridClass(openvdb::GRID_FOG_VOLUME);
        color->setName("color");
        for (const openvdb::GridBase::Ptr& grid : {openvdb::GridBase::Ptr(density), openvdb::GridBase::Ptr(color)})
            grid->setTransform(openvdb::math::Transform::createLinearTransform(world_from_index));
    }
};

/// Absorption and emission of trilinear density and colour, blended as light, over white.
void march(const ColouredBall& ball, const Camera& camera, double scale, Image& rgb, Image& opacity) {
    using openvdb::tools::BoxSampler;
    constexpr int kSide = 3;  // samples along an edge of a pixel
    const double step = 0.2 * kVoxel * scale, end = 8 * scale;
    rgb = Image(camera.width, camera.height, 3);
    opacity = Image(camera.width, camera.height, 1);
    parallelFor(static_cast<std::size_t>(camera.height), [&](std::size_t row) {
        const int y = static_cast<int>(row);
        const auto density = ball.density->getConstAccessor();
        const auto color = ball.color->getConstAccessor();
        for (int x = 0; x < camera.width; ++x) {
            Vec3d sum = Vec3d::Zero();
            double passed = 0;
            for (int k = 0; k < kSide * kSide; ++k) {
                const Ray ray = cameraRay(camera, x + (k % kSide + 0.5) / kSide, y + (k / kSide + 0.5) / kSide);
                double transmittance = 1;
                for (double t = 0.5 * step; t < end && transmittance > 1e-4; t += step) {
                    const Vec3d p = ray.origin + t * ray.direction;
                    const openvdb::Vec3d at = ball.density->worldToIndex(openvdb::Vec3d(p.data()));
                    const float sigma = BoxSampler::sample(density, at);
                    if (sigma == 0) continue;
                    const double weight = transmittance * -std::expm1(-sigma * step);
                    const openvdb::Vec3s c = BoxSampler::sample(color, at);
                    sum += weight * Vec3d(c[0], c[1], c[2]);
                    transmittance -= weight;
                }
                passed += transmittance;
            }
            constexpr double kShare = 1.0 / (kSide * kSide);
            for (int c = 0; c < 3; ++c)
                rgb.at(x, y)[c] = srgbFromLinear(static_cast<float>((sum[c] + passed) * kShare));
            opacity.at(x, y)[0] = static_cast<float>(1 - passed * kShare);
        }
    });
}

void checkInBlender(const PlacementOptions& options) {
    if (std::system("command -v blender > /dev/null 2>&1") != 0) {
        std::cout << "skipped: no blender here" << std::endl;
        ++testing::skippedTests();
        return;
    }
    const TempDir folder;
    openvdb::initialize();
    const Similarity placement = placementOf(options, {Vec3d::Constant(-0.8), Vec3d::Constant(0.8)});
    const ColouredBall ball(placement);
    openvdb::io::File((folder / "ball.vdb").string()).write(openvdb::GridCPtrVec{ball.density, ball.color});

    // Principal points off the middle, and pixels that are no squares, one way and the other.
    std::vector<ModelCamera> cameras;
    for (const double aspect : {1.0, 0.8, 1.25}) {
        Camera camera = lookAt({2.5, -1.8, 1.4}, {0.1, 0, 0}, Vec3d::UnitZ(), 0.7, 120, 100);
        camera.fy *= aspect;
        camera.cx += 9.3, camera.cy -= 6.8;
        cameras.push_back({"photo " + std::to_string(cameras.size()) + ".png", camera});
    }
    writeCamerasJson(folder / "ball.cameras.json", cameras, placement);
    writeBlenderScript(folder / "ball.blender.py", {.volumes = {"ball.vdb"},
                                                    .cameras = "ball.cameras.json",
                                                    .up = options.up.value_or(options.source_up)});
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        Image rgb, opacity;
        march(ball, placement.apply(cameras[i].camera), placement.scale, rgb, opacity);
        writeImage(folder / "rgb.png", rgb);
        writeImage(folder / "opacity.png", opacity);
        const auto path = [&](const char* name) { return " " + (folder / name).string(); };
        const std::string command =
            "blender --background --factory-startup --python-exit-code 1 --python " NERFVDB_SOURCE_DIR
            "/tests/export/blender_picture.py --" +
            path("ball.blender.py") + " color:VECTOR_FLOAT,density:FLOAT " + std::to_string(i) + path("rgb.png") +
            path("opacity.png") + " >" + path("log.txt") + " 2>&1";
        const int status = std::system(command.c_str());
        INFO(readFile(folder / "log.txt"));
        CHECK(status == 0);
    }
}

}  // namespace

TEST_CASE("Blender shows a volume as it is, from where the photographs were taken") { checkInBlender({}); }

TEST_CASE("Blender shows a volume as it is after it was scaled, tipped and moved") {
    checkInBlender({.scale = 40, .up = UpAxis::y, .origin = PlacementOptions::Origin::ground});
}
