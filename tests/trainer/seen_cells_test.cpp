// SPDX-License-Identifier: Apache-2.0
#include "trainer/seen_cells.h"

#include <cmath>

#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/nested_field.h"
#include "trainer/looks.h"
#include "vdb/ray_replay.h"

using namespace nerfvdb;

namespace {

/// A ball of fog that turns solid towards its middle, across two shells.
Model foggyBall() {
    Model model;
    model.field = test::nestedField({24, 24, 16}, 2, 4);
    const Vec3d centre = model.field.shellBox(0).center() + Vec3d(0.4, 0, 0);
    test::setNested(model.field, [&](const Vec3d& world) { return 5 - 12 * (world - centre).norm(); });
    model.decoder = Decoder(4, 1);
    return model;
}

Dataset looksAt(const Vec3d& centre) {
    Dataset dataset;
    for (const Vec3d& eye : {Vec3d(4, 0, 0), Vec3d(0, 5, 1), Vec3d(-3, -3, 2)}) {
        View view;
        view.camera = lookAt(centre + eye, centre, Vec3d::UnitZ(), 0.5, 37, 22);
        dataset.views.push_back(view);
    }
    return dataset;
}

std::size_t countBits(const std::vector<LeafMask>& masks) {
    std::size_t n = 0;
    for (const LeafMask& mask : masks) forEachBit(mask, [&](int) { ++n; });
    return n;
}

}  // namespace

TEST_CASE("cells that give a ray enough of its light are seen, as the slow way has it", "[trainer]") {
    const Model model = foggyBall();
    const VoxelField& field = model.field;
    const Topology& topology = field.topology();
    const Dataset dataset = looksAt(field.shellBox(0).center());
    const Occupancy everything = findOccupied(field, 0);
    for (const int stride : {1, 3}) {
        for (const float min_seen : {0.02f, 0.08f}) {
            std::vector<LeafMask> expected(topology.leafCount()), close(topology.leafCount());
            for (const View& view : dataset.views)
                for (int y = 0; y < view.camera.height; y += stride)
                    for (int x = 0; x < view.camera.width; x += stride) {
                        const ReplayedRay ray =
                            replayRay(model, cameraRay(view.camera, x + 0.5, y + 0.5), {}, 0.5f);
                        for (const ReplayedSample& sample : ray.samples) {
                            const auto leaf = static_cast<std::size_t>(topology.findLeaf(sample.cell / kLeafDim));
                            const int offset = brickOffset(sample.cell.x() & 7, sample.cell.y() & 7, sample.cell.z() & 7);
                            if (sample.weight >= min_seen) setBit(expected[leaf], offset);
                            // Weights differ in their last bits.
                            if (std::abs(sample.weight - min_seen) < 1e-4f) setBit(close[leaf], offset);
                        }
                    }
            std::vector<LeafMask> seen(topology.leafCount());
            markSeenCells(dataset, field, everything, min_seen, stride, seen);
            CAPTURE(stride, min_seen);
            CHECK(countBits(expected) > 5);
            std::size_t wrong = 0;
            for (std::size_t leaf = 0; leaf < seen.size(); ++leaf)
                for (int offset = 0; offset < kLeafVoxels; ++offset)
                    wrong += testBit(seen[leaf], offset) != testBit(expected[leaf], offset) && !testBit(close[leaf], offset);
            CHECK(wrong == 0);
        }
    }
}

TEST_CASE("what is seen depends on masks, not on threads, and adds to what was known", "[trainer]") {
    const Model model = foggyBall();
    const VoxelField& field = model.field;
    Dataset dataset = looksAt(field.shellBox(0).center());
    const Occupancy everything = findOccupied(field, 0);
    const auto look = [&] {
        std::vector<LeafMask> seen(field.topology().leafCount());
        markSeenCells(dataset, field, everything, 0.05f, 1, seen);
        return seen;
    };
    const std::vector<LeafMask> seen = look();
    {
        const ThreadLimit one(1);
        CHECK(look() == seen);
    }
    std::vector<LeafMask> known(field.topology().leafCount());
    setBit(known[0], 511);
    markSeenCells(dataset, field, everything, 0.05f, 1, known);
    CHECK(testBit(known[0], 511));
    CHECK(countBits(known) >= countBits(seen));

    for (View& view : dataset.views) view.mask = PixelMask(view.camera.width, view.camera.height);  // no pixel counts
    CHECK(countBits(look()) == 0);
}

TEST_CASE("looks are as far apart as a voxel at the far end of the inner box", "[trainer]") {
    const Model model = foggyBall();
    Dataset dataset = looksAt(model.field.shellBox(0).center());
    for (View& view : dataset.views) view.camera.fx = view.camera.fy = 1000;
    const int stride = strideOfLooks(dataset, model.field);
    const double diagonal = model.field.shellBox(0).size().norm();
    CHECK(stride * diagonal / 1000 <= model.field.frame().voxel_size);
    CHECK((stride + 1) * diagonal / 1000 > model.field.frame().voxel_size);
    CHECK(raysOfLooks(dataset, 10) == 3 * 4 * 3);
    dataset.views[1].camera.fx = 1;  // cannot tell voxels apart: every pixel
    CHECK(strideOfLooks(dataset, model.field) == 1);
}
