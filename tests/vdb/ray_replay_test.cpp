// SPDX-License-Identifier: Apache-2.0
#include "vdb/ray_replay.h"

#include <cmath>

#include "tests/support/catch.h"
#include "tests/support/random_field.h"
#include "vdb/renderer.h"

using namespace nerfvdb;

TEST_CASE("a replayed ray tells each sample, and ends in the colour of the picture") {
    Model model;
    model.field = test::randomField(Vec3i(32, 24, 24), 4, 0.8, -4.0f, 0.0f, 3);
    model.decoder = Decoder(4, 1, 16);
    model.background = Vec3f(0.2f, 0.4f, 0.6f);
    const Box box = model.field.worldBox();
    const Camera camera = lookAt(box.center() + Vec3d(0.1, 0.2, 2.5 * box.size().norm()), box.center(),
                                 Vec3d::UnitY(), 0.5, 20, 20);
    RenderOptions options;
    options.trace.min_weight = 0;
    const RenderedImage picture = Renderer(model, options).render(camera);
    int n_lit = 0;
    for (int y = 0; y < 20; y += 3)
        for (int x = 0; x < 20; x += 3) {
            CAPTURE(x, y);
            const ReplayedRay ray = replayRay(model, cameraRay(camera, x + 0.5, y + 0.5), {}, 0.5f);
            double sum = ray.transmittance;
            for (const ReplayedSample& sample : ray.samples) sum += sample.weight;
            CHECK(sum == Approx(1).margin(1e-6));
            for (std::size_t i = 0; i < ray.samples.size(); ++i) {
                const ReplayedSample& sample = ray.samples[i];
                if (i > 0) CHECK(sample.t > ray.samples[i - 1].t);
                const Vec3d cell = model.field.frame().indexFromWorld(
                    camera.position + sample.t * cameraRay(camera, x + 0.5, y + 0.5).direction);
                for (int axis = 0; axis < 3; ++axis) {
                    CHECK(cell[axis] >= sample.cell[axis] - 1e-3);
                    CHECK(cell[axis] <= sample.cell[axis] + 1 + 1e-3);
                }
                CHECK(sample.tau == Approx(sample.sigma * 0.5 * model.field.frame().voxel_size).epsilon(1e-5));
                CHECK(sample.features.size() == 4);
            }
            for (int c = 0; c < 3; ++c) CHECK(ray.color[c] == Approx(picture.rgb.at(x, y)[c]).margin(1e-5));
            n_lit += !ray.samples.empty();
        }
    CHECK(n_lit > 10);
}

TEST_CASE("a ray that meets nothing has no samples and shows the background") {
    Model model;
    model.field = test::randomField(Vec3i(16, 16, 16), 4, 0.8, -4.0f, 0.0f, 3);
    model.decoder = Decoder(4, 1, 16);
    const Box box = model.field.worldBox();
    const ReplayedRay ray = replayRay(model, {box.max + Vec3d::Ones(), Vec3d::UnitX()}, {}, 0.5f);
    CHECK(ray.samples.empty());
    CHECK(ray.transmittance == 1);
    CHECK(ray.color == model.background);
}
