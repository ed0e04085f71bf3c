// SPDX-License-Identifier: Apache-2.0
// Map coordinates: a scene five thousand kilometres from its origin trains as well as one at home. Positions are kept
// in double and rays relative to the scene's own origin.
#include "core/metrics.h"
#include "tests/support/catch.h"
#include "tests/support/sphere_dataset.h"
#include "trainer/trainer.h"
#include "vdb/renderer.h"

using namespace nerfvdb;

namespace {

const Vec3d kAway(5e6, -3e6, 4e6);

Dataset movedBy(Dataset dataset, const Vec3d& shift) {
    for (View& view : dataset.views) view.camera.position += shift;
    return dataset;
}

Image pictureAfterTraining(const Dataset& dataset, SceneExtent extent, const Camera& camera) {
    TrainOptions options;
    options.steps = {150};
    options.extent = extent;
    Report quiet;
    const Model model = train(dataset, options, quiet, {}).model;
    return Renderer(model, {}).render(camera).rgb;
}

}  // namespace

TEST_CASE("a scene at 5e6 metres trains to the same picture") {
    const Dataset home = test::surroundedSphereDataset(12, 48);
    const Dataset away = movedBy(home, kAway);
    const Camera camera = home.views[5].camera;
    Camera moved = camera;
    moved.position += kAway;
    for (const SceneExtent extent : {SceneExtent::box, SceneExtent::open}) {
        const Image at_home = pictureAfterTraining(home, extent, camera);
        const Image far_away = pictureAfterTraining(away, extent, moved);
        // At 7e6 a double has steps of 1e-9, and training amplifies what is rounded otherwise; but no more than noise.
        CHECK(psnr(at_home, far_away) > 35);
        CHECK(psnr(at_home, Image(at_home.width, at_home.height, 3)) < 20);  // it shows something
    }
}
