// SPDX-License-Identifier: Apache-2.0
#include "export/volume_colors.h"

#include "core/image.h"
#include "core/parallel.h"
#include "export/marching_cubes.h"
#include "export/vertex_colours.h"
#include "export/volume_of_model.h"
#include "tests/support/catch.h"
#include "tests/support/seen_model.h"

using namespace nerfvdb;

namespace {

Report silent;

/// A model that decodes to one colour, whatever the features and the direction: the last layer is all bias.
Model plainModel(const Vec3f& srgb) {
    Model model = test::seenModel();
    for (float& value : model.field.features()) value = 0;
    for (float& weight : model.decoder.parameters()) weight = 0;
    for (std::size_t i = 0; i < model.field.features().size(); i += model.field.channels())
        for (int c = 0; c < 3; ++c) model.field.features()[i + c] = std::log(srgb[c] / (1 - srgb[c]));
    return model;
}

std::size_t count(std::span<const LeafMask> masks) {
    std::size_t n = 0;
    for (const LeafMask& mask : masks) forEachBit(mask, [&](int) { ++n; });
    return n;
}

}  // namespace

TEST_CASE("a scene of one colour is collected in that colour, to the border of its cells") {
    const Vec3f srgb(0.2f, 0.5f, 0.9f);
    const Model model = plainModel(srgb);
    Volume volume = volumeOfModel(model.field, {});
    const std::vector<LeafMask> seen =
        collectColors(model, test::trainingCameras(model), {}, volume, silent);
    CHECK(count(seen) > 1000);
    std::size_t wrong = 0, n_seen_without = 0;
    for (std::size_t leaf = 0; leaf < seen.size(); ++leaf)
        forEachBit(volume.topology().voxels()[leaf], [&](int offset) {
            const float* const color = &volume.color()[(leaf * kLeafVoxels + offset) * Volume::kChannels];
            const bool is_black = color[0] == 0 && color[1] == 0 && color[2] == 0;
            n_seen_without += is_black && testBit(seen[leaf], offset);
            if (is_black) return;  // far from all that was seen
            for (int c = 0; c < 3; ++c) wrong += !(std::abs(color[c] - linearFromSrgb(srgb[c])) < 1e-4f);
        });
    CHECK(wrong == 0);
    CHECK(n_seen_without == 0);
}

TEST_CASE("what lies behind opaque matter is not seen, unless a camera stands there") {
    Model model = test::seenModel(48);
    for (float& raw : model.field.density()) raw = 8;  // a wall four voxels thick, each of optical depth 6000
    VolumeGridOptions grid;
    Volume volume = volumeOfModel(model.field, grid);
    const Vec3d centre = model.field.worldBox().center();
    const auto innermostSeen = [&](const std::vector<Camera>& cameras) {
        const std::vector<LeafMask> seen = collectColors(model, cameras, {}, volume, silent);
        double radius = 1e9;
        for (std::size_t leaf = 0; leaf < seen.size(); ++leaf)
            forEachBit(seen[leaf], [&](int offset) {
                const Vec3i ijk = test::voxelOf(volume.topology(), leaf, offset);
                radius = std::min(radius, (volume.frame().worldFromIndex(ijk.cast<double>()) - centre).norm());
            });
        return radius / volume.frame().voxel_size;
    };
    const double wall = 48 * 0.375;  // radius of its middle, voxels
    // Light ends within a voxel of the outer face, two voxels out; the voxels of its cells reach two further in.
    CHECK(innermostSeen(test::trainingCameras(model)) > wall - 1);
    CHECK(innermostSeen({lookAt(centre, centre + Vec3d::UnitX(), Vec3d::UnitZ(), 1.5, 48, 48)}) < wall - 2);
}

TEST_CASE("colours do not depend on the number of threads") {
    const Model model = test::seenModel();
    Volume many = volumeOfModel(model.field, {}), one = volumeOfModel(model.field, {});
    const std::vector<LeafMask> seen = collectColors(model, test::trainingCameras(model), {}, many, silent);
    const ThreadLimit limit(1);
    CHECK(collectColors(model, test::trainingCameras(model), {}, one, silent) == seen);
    CHECK(std::equal(many.color().begin(), many.color().end(), one.color().begin()));
}

TEST_CASE("decoded colours are the model's mean over directions") {
    const Model model = test::seenModel();
    Volume volume = volumeOfModel(model.field, {});
    decodeColors(model, volume);
    const VoxelField& field = model.field;
    std::size_t wrong = 0, n = 0;
    for (std::size_t leaf = 0; leaf < volume.topology().leafCount(); ++leaf)
        forEachBit(volume.active()[leaf], [&](int offset) {
            if (++n % 16 != 1) return;
            const Vec3i ijk = test::voxelOf(volume.topology(), leaf, offset) + volume.firstVoxel();
            const int from = field.topology().findLeaf(ijk / kLeafDim);
            REQUIRE(from >= 0);
            const std::size_t voxel =
                from * std::size_t{kLeafVoxels} + brickOffset(ijk.x() & 7, ijk.y() & 7, ijk.z() & 7);
            float srgb[3];
            model.decoder.diffuse(1, &field.features()[voxel * field.channels()], srgb);
            for (int c = 0; c < 3; ++c)
                // batches of another size may round differently in the last bits
                wrong += !(std::abs(volume.color()[(leaf * kLeafVoxels + offset) * Volume::kChannels + c] -
                                    linearFromSrgb(srgb[c])) < 1e-5f);
        });
    CHECK(n > 1000);
    CHECK(wrong == 0);
}

TEST_CASE("vertices take the colours that the training views saw, else those of the features") {
    Model model = test::seenModel();
    model.cameras.resize(1);
    MeshOptions options;
    options.colours = false;
    const Mesh mesh = extractSurface(model, options, silent);
    REQUIRE(mesh.positions.size() > 1000);
    Mesh seen = mesh, decoded = mesh;
    colourVertices(model, seen, silent);
    colourVertices(model.decoder, model.field, decoded);
    const Vec3d eye = model.cameras[0].camera.position, centre = model.field.worldBox().center();
    std::size_t n_front = 0, differ_in_front = 0, n_back = 0, differ_behind = 0;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        const Vec3d from_centre = mesh.positions[v].cast<double>() - centre;
        const double side = from_centre.normalized().dot((eye - centre).normalized());
        const bool is_other = seen.colours[v] != decoded.colours[v];
        if (side > 0.9 && from_centre.norm() > 0.95) ++n_front, differ_in_front += is_other;
        if (side < -0.9 && from_centre.norm() > 0.95) ++n_back, differ_behind += is_other;
    }
    CHECK(n_front > 20);
    CHECK(differ_in_front > n_front / 2);
    CHECK(n_back > 20);
    CHECK(differ_behind < n_back / 2);  // the shell lets a little light through

    Mesh without = mesh;
    model.cameras.clear();
    colourVertices(model, without, silent);
    CHECK(without.colours == decoded.colours);
}
