// SPDX-License-Identifier: Apache-2.0
#include "trainer/ply_points.h"

#include <cmath>
#include <cstring>
#include <string>

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"
#include "tests/trainer/scene_folder.h"
#include "trainer/read_transforms.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;

namespace {

const std::string kText = "ply\nformat ascii 1.0\ncomment as nerfstudio writes it\nelement vertex 2\nproperty float x\n"
                          "property float y\nproperty float z\nproperty uint8 red\nend_header\n1 -2.5 3e1 255\n0 .5 -1 7\n";

template <typename T>
void append(std::string& bytes, T value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(raw, sizeof value);
}

}  // namespace

TEST_CASE("points come from text and from binary files, whatever else a vertex has", "[trainer]") {
    const TempDir dir;
    writeAtomically(dir / "text.ply", kText);
    CHECK(readPlyPoints(dir / "text.ply") == std::vector<Vec3d>{{1, -2.5, 30}, {0, 0.5, -1}});

    std::string binary = "ply\r\nformat binary_little_endian 1.0\r\nelement vertex 2\r\nproperty uchar red\r\nproperty double z\r\n"
                         "property float x\r\nproperty float y\r\nelement face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n";
    for (const double i : {1.0, 2.0}) {
        append(binary, std::uint8_t{9});
        append(binary, 3e6 * i);
        append(binary, static_cast<float>(i));
        append(binary, static_cast<float>(-i));
    }
    writeAtomically(dir / "binary.ply", binary + std::string(13, '\0'));
    CHECK(readPlyPoints(dir / "binary.ply") == std::vector<Vec3d>{{1, -1, 3e6}, {2, -2, 6e6}});

    writeAtomically(dir / "none.ply", "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n");
    CHECK(readPlyPoints(dir / "none.ply").empty());
    writeAtomically(dir / "far.ply", std::string(kText).replace(kText.find("3e1"), 3, "1e999"));
    CHECK_FALSE(readPlyPoints(dir / "far.ply")[0].allFinite());
    writeAtomically(dir / "near.ply", std::string(kText).replace(kText.find("3e1"), 3, "1e-999"));
    CHECK(readPlyPoints(dir / "near.ply")[0] == Vec3d(1, -2.5, 0));
    const std::string comment = "comment the end_header comes later";
    writeAtomically(dir / "comment.ply", std::string(kText).replace(kText.find("comment as"), 29, comment));
    CHECK(readPlyPoints(dir / "comment.ply").size() == 2);
}

TEST_CASE("points that cannot be read are named", "[trainer]") {
    const TempDir dir;
    const auto with = [&](const std::string& from, const std::string& to) {
        writeAtomically(dir / "bad.ply", std::string(kText).replace(kText.find(from), from.size(), to));
        return dir / "bad.ply";
    };
    CHECK_THROWS_AS(readPlyPoints(dir / "absent.ply"), IoError);
    CHECK_THROWS_WITH(readPlyPoints(with("ply\n", "obj\n")), Contains("bad.ply") && Contains("no PLY header"));
    CHECK_THROWS_WITH(readPlyPoints(with("ascii", "binary_big_endian")), Contains("binary_big_endian"));
    CHECK_THROWS_WITH(readPlyPoints(with("format ascii 1.0\n", "")), Contains("without a format"));
    CHECK_THROWS_WITH(readPlyPoints(with("element vertex 2", "element vertex many")), Contains("many"));
    CHECK_THROWS_WITH(readPlyPoints(with("element vertex 2", "element vertex 18446744073709551615")), Contains("truncated"));
    CHECK_THROWS_WITH(readPlyPoints(with("element vertex 2", "element vertex 3")), Contains("bad.ply"));
    CHECK_THROWS_WITH(readPlyPoints(with("element vertex", "element face")), Contains("no vertices first"));
    CHECK_THROWS_WITH(readPlyPoints(with("float y", "float w")), Contains("without float or double x, y and z"));
    CHECK_THROWS_WITH(readPlyPoints(with("float y", "int y")), Contains("without float or double x, y and z"));
    CHECK_THROWS_WITH(readPlyPoints(with("uint8 red", "list uchar int red")), Contains("a list"));
    CHECK_THROWS_WITH(readPlyPoints(with("uint8 red", "colour red")), Contains("colour"));
    CHECK_THROWS_WITH(readPlyPoints(with("-2.5", "two")), Contains("vertex 0") && Contains("write the points anew"));
    CHECK_THROWS_WITH(readPlyPoints(with("1 -2.5", "1-2.5")), Contains("vertex 0"));
    CHECK_THROWS_WITH(readPlyPoints(with("element vertex 2", "element vertex -1")), Contains("element vertex -1"));
    CHECK_THROWS_WITH(readPlyPoints(with("-1 7\n", "-1\n")), Contains("vertex 1"));
}

TEST_CASE("the points beside a list of frames are the data set's, if they are there and not at infinity", "[trainer]") {
    SceneFolder scene(4);
    scene.document["ply_file_path"] = "sparse_pc.ply";
    scene.save("transforms_train.json");
    const Dataset without = readTransforms(scene.dir.path(), Split::train, true);
    CHECK(without.points.empty());
    REQUIRE(without.warnings.size() == 1);
    CHECK_THAT(without.warnings[0], Contains("ply_file_path: no file sparse_pc.ply"));

    std::string text = kText;
    text.replace(text.find("3e1"), 3, "1e9");
    writeAtomically(scene.dir / "sparse_pc.ply", text);
    const Dataset with = readTransforms(scene.dir.path(), Split::train, true);
    CHECK(with.points == std::vector<Vec3d>{{0, 0.5, -1}});
    REQUIRE(with.warnings.size() == 1);
    CHECK_THAT(with.warnings[0], Contains("1 of 2 points are not finite, or"));

    writeAtomically(scene.dir / "sparse_pc.ply", "ply");
    const Dataset damaged = readTransforms(scene.dir.path(), Split::train, true);
    CHECK(damaged.points.empty());
    REQUIRE(damaged.warnings.size() == 1);
    CHECK_THAT(damaged.warnings[0], Contains("sparse_pc.ply: found no PLY header") && Contains("training goes on without"));
}
