// SPDX-License-Identifier: Apache-2.0
#include "export/volume_of_model.h"

#include <cmath>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/shell_model.h"
#include "vdb/vdb_file.h"

using namespace nerfvdb;

namespace {

/// Optical depth of a whole grid per area: sum of sigma times the volume of a voxel.
double mass(std::span<const float> sigma, double voxel_size) {
    double sum = 0;
    for (const float value : sigma) sum += value;
    return sum * voxel_size * voxel_size * voxel_size;
}

Model softShell(int n) {
    Model model = test::shellModel(n);
    for (float& raw : model.field.density()) raw -= 4;  // far below the cap on either grid
    return model;
}

}  // namespace

TEST_CASE("on the model's own voxels a volume holds its sigma, capped, where it is visible") {
    const Model model = test::shellModel(32);
    const VoxelField& field = model.field;
    VolumeGridOptions options;
    options.min_alpha = 0.8;
    const Volume volume = volumeOfModel(field, options);
    std::size_t wrong = 0, n_active = 0, n_expected = 0;
    for (std::size_t leaf = 0; leaf < volume.topology().leafCount(); ++leaf)
        forEachBit(volume.topology().voxels()[leaf], [&](int offset) {
            const Vec3i ijk = test::voxelOf(volume.topology(), leaf, offset) + volume.firstVoxel();
            const int from = (ijk.array() < 0).any() ? -1 : field.topology().findLeaf(ijk / kLeafDim);
            float expected = 0;
            if (from >= 0) {
                const int at = brickOffset(ijk.x() & 7, ijk.y() & 7, ijk.z() & 7);
                const float sigma = volumeSigma(field.density()[from * std::size_t{kLeafVoxels} + at],
                                                field.densityScale(), field.frame().voxel_size);
                const double alpha = 1 - std::exp(-static_cast<double>(sigma) * field.frame().voxel_size);
                if (testBit(field.topology().voxels()[from], at) && alpha >= 0.8) expected = sigma;
            }
            n_active += testBit(volume.active()[leaf], offset);
            n_expected += expected > 0;
            wrong += volume.sigma()[leaf * kLeafVoxels + offset] != expected;
        });
    CHECK(wrong == 0);
    CHECK(n_active == n_expected);
    CHECK(n_active > 1000);
    CHECK(n_active < field.topology().voxelCount());
}

TEST_CASE("coarser voxels stop as much light") {
    const Model model = softShell(48);
    VolumeGridOptions options;
    options.min_alpha = 0;
    const double fine = mass(volumeOfModel(model.field, options).sigma(), model.field.frame().voxel_size);
    for (const double scale : {1.25, 2.0, 3.7}) {
        CAPTURE(scale);
        options.voxel_scale = scale;
        const Volume coarse = volumeOfModel(model.field, options);
        CHECK(coarse.frame().voxel_size == Approx(scale * model.field.frame().voxel_size));
        // Each fine voxel's eight weights sum to one: nothing is lost or made.
        CHECK(mass(coarse.sigma(), coarse.frame().voxel_size) == Approx(fine).epsilon(1e-4));
    }
}

TEST_CASE("finer voxels hold what the field says between its own") {
    const Model model = softShell(32);
    const VoxelField& field = model.field;
    VolumeGridOptions options;
    options.min_alpha = 0;
    for (const int times : {2, 3, 4}) {
        CAPTURE(times);
        options.voxel_scale = 1.0 / times;
        const Volume fine = volumeOfModel(field, options);
        CHECK(fine.frame().voxel_size == Approx(field.frame().voxel_size / times));
        std::size_t n = 0, wrong = 0;
        std::size_t n_between = 0;
        for (std::size_t leaf = 0; leaf < fine.topology().leafCount(); ++leaf)
            forEachBit(fine.active()[leaf], [&](int offset) {
                const Vec3i ijk = test::voxelOf(fine.topology(), leaf, offset) + fine.firstVoxel();
                const float sigma = fine.sigma()[leaf * kLeafVoxels + offset];
                const Vec3i low = ijk / times, rest = ijk - low * times;
                const int at = field.topology().findLeaf(low / kLeafDim);
                REQUIRE(at >= 0);
                const auto raw = [&](const Vec3i& voxel) {
                    const int of = field.topology().findLeaf(voxel / kLeafDim);
                    return field.density()[static_cast<std::size_t>(of) * kLeafVoxels +
                                           brickOffset(voxel.x() & 7, voxel.y() & 7, voxel.z() & 7)];
                };
                // On the lines between two voxels along an axis; elsewhere the formula is the same, in three.
                if ((rest.array() > 0).count() > 1) return;
                ++n;
                int axis = 0;
                const float u = static_cast<float>(rest.maxCoeff(&axis)) / static_cast<float>(times);
                const float between = u == 0 ? raw(low) : (1 - u) * raw(low) + u * raw(low + Vec3i::Unit(axis));
                const float expected = sigmaFromRaw(between, field.densityScale());
                wrong += !(std::abs(sigma - expected) <= 1e-4f * expected);
                n_between += u > 0;
            });
        CHECK(n > 10000);
        CHECK(wrong == 0);
        CHECK(n_between > n / 2);
    }
}

TEST_CASE("volumes that cannot be are refused") {
    const Model model = test::shellModel(24);
    for (const double bad : {0.4, 0.0, static_cast<double>(NAN), static_cast<double>(INFINITY)}) {
        VolumeGridOptions options;
        options.voxel_scale = bad;
        CHECK_THROWS_AS(volumeOfModel(model.field, options), UsageError);
    }
    for (const double bad : {-0.1, 1.0, static_cast<double>(NAN)}) {
        VolumeGridOptions options;
        options.min_alpha = bad;
        CHECK_THROWS_AS(volumeOfModel(model.field, options), UsageError);
    }
}
