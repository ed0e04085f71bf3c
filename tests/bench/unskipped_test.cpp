// SPDX-License-Identifier: Apache-2.0
// Rays that walk where they could have jumped see the same picture, and more samples.
#include "bench/unskipped.h"

#include "core/metrics.h"
#include "tests/bench/subject.h"
#include "tests/support/catch.h"
#include "vdb/renderer.h"

using namespace nerfvdb;

TEST_CASE("pictures stay right however much is walked through; samples tell what was skipped") {
    const Subject subject = test::sphereSubject();
    const Unskipped unskipped(subject.model);
    const Camera& camera = subject.test.views.front().camera;
    const RenderedImage plain = Renderer(subject.model, {}).render(camera);

    const RenderedImage walked = Renderer(subject.model, {}, unskipped.walkedLeaves()).render(camera);
    CHECK(walked.rgb.pixels == plain.rgb.pixels);  // the same samples, found more slowly
    CHECK(walked.counters.samples_density == plain.counters.samples_density);

    const RenderedImage whole = Renderer(unskipped.full(), {}, unskipped.wholeLeaves()).render(camera);
    CHECK(whole.counters.samples_density > plain.counters.samples_density);
    // What it looks at in addition stops less than 1 % of the light over a voxel.
    CHECK(psnr(whole.rgb, plain.rgb) > 35);

    const auto box = unskipped.wholeBox();
    REQUIRE(box);
    RenderOptions to_the_end;
    to_the_end.trace.stop_transmittance = 0;
    const RenderedImage dense = Renderer(unskipped.full(), to_the_end, *box).render(camera);
    // A dense march: every sample in the box, but for rounding at its border.
    CHECK(static_cast<double>(dense.counters.samples_density) ==
          Approx(static_cast<double>(dense.counters.samples_dense)).epsilon(0.05));
    CHECK(psnr(dense.rgb, whole.rgb) > 45);  // the empty leaf holds nothing
}

TEST_CASE("a source aimed at the whole box draws rays that meet nothing") {
    const Subject subject = test::sphereSubject();
    RaySource source(subject.train, 1);
    source.update(subject.model.field, findOccupied(subject.model.field, 0.01f));
    const std::size_t live = source.tileCount();
    aimAtWholeBox(source, subject.model.field);
    CHECK(source.tileCount() > live);
}
