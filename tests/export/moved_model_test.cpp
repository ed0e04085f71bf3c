// SPDX-License-Identifier: Apache-2.0
#include "export/moved_model.h"

#include <utility>

#include "export/marching_cubes.h"
#include "export/vertex_colours.h"
#include "tests/support/catch.h"
#include "tests/support/seen_model.h"

using namespace nerfvdb;

TEST_CASE("meshed from an origin nearby, a model in map coordinates is the same as at home") {
    // Coordinates that doubles hold with bits to spare, so that nothing is rounded on the way there.
    const Vec3d away(0x1p22, -0x1p21, 0x1p10);
    const Model home = test::seenModel(32);
    Model far_away = movedModel(test::seenModel(32), -away);
    CHECK(far_away.field.frame().origin == home.field.frame().origin + away);
    CHECK(far_away.cameras[0].camera.position == home.cameras[0].camera.position + away);
    const Model back = movedModel(std::move(far_away), away);
    Report silent;
    MeshOptions options;
    options.colours = false;
    Mesh expected = extractSurface(home, options, silent), mesh = extractSurface(back, options, silent);
    REQUIRE(expected.positions.size() > 100);
    REQUIRE(mesh.positions.size() == expected.positions.size());
    CHECK(mesh.triangles == expected.triangles);
    double farthest = 0;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v)
        farthest = std::max(farthest, static_cast<double>((mesh.positions[v] - expected.positions[v]).norm()));
    CHECK(farthest < 1e-5 * home.field.worldBox().size().norm());  // 2^22 in a double: steps of 1e-9

    // Colours are those that the cameras see, which have moved, too.
    colourVertices(home, expected, silent);
    colourVertices(back, mesh, silent);
    std::size_t n_other = 0;  // which of two cells a ray meets at their face, rounding decides
    for (std::size_t v = 0; v < mesh.positions.size(); ++v)
        n_other += (mesh.colours[v].cast<int>() - expected.colours[v].cast<int>()).cwiseAbs().maxCoeff() > 2;
    CHECK(static_cast<double>(n_other) < 0.02 * static_cast<double>(mesh.positions.size()));

    struct Notes : Report {
        void warn(const std::string& line) override { lines += line; }
        std::string lines;
    } notes;
    extractSurface(movedModel(test::seenModel(32), -1e3 * away), options, notes);
    CHECK_THAT(notes.lines, Catch::Contains("'nerfvdb mesh --origin"));
}
