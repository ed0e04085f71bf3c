// SPDX-License-Identifier: Apache-2.0
#include "export/cropped_model.h"

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/seen_model.h"
#include "vdb/renderer.h"

using namespace nerfvdb;

TEST_CASE("a cropped model has what lies in the box, unchanged, and nothing else") {
    const Model model = test::seenModel(48);
    const VoxelField& field = model.field;
    const Box whole = field.worldBox();
    const Box half{whole.min, {whole.center().x(), whole.max.y(), whole.max.z()}};
    const Model cropped = croppedModel(model, half);
    const Topology& topology = cropped.field.topology();
    std::size_t wrong = 0, n = 0;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const Vec3i ijk = test::voxelOf(topology, leaf, offset);
            const std::size_t from = static_cast<std::size_t>(field.topology().findLeaf(ijk / kLeafDim)) * kLeafVoxels;
            const std::size_t to = leaf * kLeafVoxels;
            wrong += !half.contains(field.frame().worldFromIndex(ijk.cast<double>()));
            wrong += cropped.field.density()[to + offset] != field.density()[from + offset];
            for (int c = 0; c < 8; ++c)
                wrong += cropped.field.features()[(to + offset) * 8 + c] != field.features()[(from + offset) * 8 + c];
            ++n;
        });
    CHECK(wrong == 0);
    CHECK(n > 0.4 * static_cast<double>(field.topology().voxelCount()));
    CHECK(n < 0.6 * static_cast<double>(field.topology().voxelCount()));
    CHECK(cropped.cameras.size() == model.cameras.size());
    CHECK(cropped.background == model.background);

    // What was hidden behind the missing half shows.
    const Camera from_missing_side = lookAt(whole.center() + Vec3d(4, 0, 0), whole.center(), Vec3d::UnitZ(), 0.6, 32, 32);
    const RenderedImage before = Renderer(model, {}).render(from_missing_side);
    const RenderedImage after = Renderer(cropped, {}).render(from_missing_side);
    CHECK(*after.depth.at(16, 16) > *before.depth.at(16, 16) + 0.5);

    CHECK_THROWS_AS(croppedModel(model, {whole.max + Vec3d::Ones(), whole.max + Vec3d::Constant(2)}), DataError);
}
