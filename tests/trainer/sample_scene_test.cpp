// SPDX-License-Identifier: Apache-2.0
#include "trainer/sample_scene.h"

#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "trainer/exact_ray.h"
#include "vdb/renderer.h"

using namespace nerfvdb;

TEST_CASE("a sampled scene holds the scene's own values at its voxels", "[sample_scene]") {
    for (const std::string& name : syntheticSceneNames()) {
        INFO(name);
        const auto scene = makeSyntheticScene(name);
        const Model model = sampleScene(*scene, 64);
        const VoxelField& field = model.field;
        const Topology& topology = field.topology();
        REQUIRE(topology.leafCount() > 0);
        double worst_density = 0, worst_colour = 0;
        double stored = 0;
        for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
            for (int v = 0; v < kLeafVoxels; ++v) {
                if (!testBit(topology.voxels()[leaf], v)) continue;
                const Vec3i ijk = 8 * topology.leafCoords()[leaf] + Vec3i(v >> 6, v >> 3 & 7, v & 7);
                const Vec3d p = field.frame().worldFromIndex(ijk.cast<double>());
                const std::size_t slot = leaf * kLeafVoxels + v;
                const double sigma = sigmaFromRaw(field.density()[slot], field.densityScale());
                worst_density =
                    std::max(worst_density, std::abs(sigma - scene->density(p)) / scene->maxDensity());
                stored += scene->density(p);
                if (v % 61 != 0)
                    continue;  // the decoder's mean over directions is slow for one voxel at a time
                float rgb[3];
                model.decoder.diffuse(1, &field.features()[slot * field.channels()], rgb);
                for (int c = 0; c < 3; ++c)
                    worst_colour = std::max(worst_colour, std::abs(rgb[c] - scene->diffuse(p)[c]));
            }
        }
        CHECK(worst_density < 1e-6);             // single precision, through log and exp
        CHECK(worst_colour < 0.5 / 255 + 1e-5);  // colours are kept half a level away from 0 and 1
        // Nothing that has density is left out: the same sum over every grid point.
        double everything = 0;
        for (int x = 0; x < topology.dims().x(); ++x)
            for (int y = 0; y < topology.dims().y(); ++y)
                for (int z = 0; z < topology.dims().z(); ++z)
                    everything += scene->density(field.frame().worldFromIndex(Vec3d(x, y, z)));
        CHECK(stored == Approx(everything).epsilon(1e-4));
        if (name != "fog") CHECK(topology.cellCount() < 0.5 * topology.dims().cast<double>().prod());
    }
}

TEST_CASE("sampling does not depend on the number of threads", "[sample_scene]") {
    const auto scene = makeSyntheticScene("shell");
    const Model a = sampleScene(*scene, 48);
    const ThreadLimit one(1);
    const Model b = sampleScene(*scene, 48);
    CHECK(std::ranges::equal(a.field.topology().leafCoords(), b.field.topology().leafCoords()));
    CHECK(std::ranges::equal(a.field.density(), b.field.density()));
    CHECK(std::ranges::equal(a.field.features(), b.field.features()));
}

TEST_CASE("a sampled scene renders like the scene itself", "[sample_scene]") {
    // Two renderers that share no code look at one scene. What sampling loses sets the bound: voxels of 0.013
    // across an edge 0.04 wide whose logarithm, not its value, is interpolated.
    const auto scene = makeSyntheticScene("sphere");
    const Model model = sampleScene(*scene, 128);
    const Camera camera = lookAt({2.6, -2.4, 1.6}, Vec3d::Zero(), Vec3d::UnitZ(), 0.69, 96, 96);
    const Image rendered = Renderer(model, {}).render(camera).rgb;
    const Image exact = exactImage(*scene, camera);
    double squared = 0;
    for (int i = 0; i < 96 * 96; ++i)
        for (int c = 0; c < 3; ++c) {
            const double on_white = 1 + exact.pixels[4 * i + 3] * (exact.pixels[4 * i + c] - 1);
            squared += std::pow(rendered.pixels[3 * i + c] - on_white, 2);
        }
    const double quality = -10 * std::log10(squared / (3 * 96 * 96));
    INFO("PSNR " << quality);
    CHECK(quality > 30);
}

TEST_CASE("sampling wants a sane resolution", "[sample_scene]") {
    const auto scene = makeSyntheticScene("sphere");
    REQUIRE_THROWS_AS(sampleScene(*scene, 4), UsageError);
    REQUIRE_THROWS_AS(sampleScene(*scene, 100000), UsageError);
}
