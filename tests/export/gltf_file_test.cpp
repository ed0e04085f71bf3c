// SPDX-License-Identifier: Apache-2.0
// The file is taken apart by hand, as the glTF 2.0 specification says, and not by the library that wrote it.
#include "export/gltf_file.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>

#include "core/atomic_file.h"
#include "core/error.h"
#include "export/mesh_io.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;
using nlohmann::json;

namespace {

struct Glb {
    json scene;
    std::string binary;
};

std::uint32_t wordAt(const std::string& bytes, std::size_t offset) {
    std::uint32_t word;
    REQUIRE(offset + 4 <= bytes.size());
    std::memcpy(&word, bytes.data() + offset, 4);
    return word;
}

Glb parse(const std::string& bytes) {
    CHECK(bytes.substr(0, 4) == "glTF");
    CHECK(wordAt(bytes, 4) == 2);
    CHECK(wordAt(bytes, 8) == bytes.size());
    const std::uint32_t json_size = wordAt(bytes, 12);
    CHECK(json_size % 4 == 0);
    CHECK(bytes.substr(16, 4) == "JSON");
    Glb glb;
    glb.scene = json::parse(bytes.substr(20, json_size));
    const std::uint32_t binary_size = wordAt(bytes, 20 + json_size);
    CHECK(binary_size % 4 == 0);
    CHECK(bytes.substr(24 + json_size, 4) == std::string("BIN\0", 4));
    glb.binary = bytes.substr(28 + json_size);
    CHECK(glb.binary.size() == binary_size);
    CHECK(glb.scene["buffers"].size() == 1);
    CHECK(glb.scene["buffers"][0]["byteLength"].get<std::size_t>() <= binary_size);
    CHECK_FALSE(glb.scene["buffers"][0].contains("uri"));
    return glb;
}

template <typename T>
std::vector<T> array(const Glb& glb, int accessor_number, int component_type, const std::string& type, int target,
                     std::size_t per_item = 1) {
    const json& accessor = glb.scene["accessors"][accessor_number];
    CHECK(accessor["componentType"] == component_type);
    CHECK(accessor["type"] == type);
    const json& view = glb.scene["bufferViews"][accessor["bufferView"].get<int>()];
    CHECK(view["buffer"] == 0);
    CHECK(view["target"] == target);
    CHECK_FALSE(view.contains("byteStride"));
    const std::size_t count = accessor["count"], offset = view.value("byteOffset", 0);
    CHECK(offset % 4 == 0);
    REQUIRE(view["byteLength"] == count / per_item * sizeof(T));
    REQUIRE(offset + count / per_item * sizeof(T) <= glb.binary.size());
    std::vector<T> items(count / per_item);
    std::memcpy(static_cast<void*>(items.data()), glb.binary.data() + offset, items.size() * sizeof(T));
    return items;
}

constexpr int kFloat = 5126, kUnsignedShort = 5123, kUnsignedInt = 5125, kVertices = 34962, kIndices = 34963;

Mesh smallMesh() {
    Mesh mesh;
    mesh.positions = {{0.1f, -2, 3e-7f}, {1, 0, 0}, {0, 1.0f / 3, 0}, {1e6f, 0, 1}};
    mesh.normals = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}, {0.6f, 0, -0.8f}};
    mesh.colours = {{0, 1, 2}, {255, 254, 253}, {10, 11, 64}, {128, 188, 255}};
    mesh.triangles = {{0, 1, 2}, {3, 2, 1}};
    return mesh;
}

}  // namespace

TEST_CASE("a glTF file holds what the mesh holds, its colours linear", "[export]") {
    const TempDir folder;
    const Mesh mesh = smallMesh();
    writeMesh(folder / "m.glb", mesh);
    const Glb glb = parse(readFile(folder / "m.glb"));
    CHECK(glb.scene["asset"]["version"] == "2.0");
    REQUIRE(glb.scene["meshes"].size() == 1);
    const json& primitive = glb.scene["meshes"][0]["primitives"][0];
    CHECK(primitive.value("mode", 4) == 4);
    const json& attributes = primitive["attributes"];
    CHECK(array<Vec3f>(glb, attributes["POSITION"], kFloat, "VEC3", kVertices) == mesh.positions);
    CHECK(array<Vec3f>(glb, attributes["NORMAL"], kFloat, "VEC3", kVertices) == mesh.normals);
    CHECK(array<Triangle>(glb, primitive["indices"], kUnsignedInt, "SCALAR", kIndices, 3) == mesh.triangles);

    const json& position = glb.scene["accessors"][attributes["POSITION"].get<int>()];
    const auto bound = [&](const char* name, int axis) { return position[name][axis].get<float>(); };
    CHECK(Vec3f(bound("min", 0), bound("min", 1), bound("min", 2)) == Vec3f(0, -2, 0));
    CHECK(Vec3f(bound("max", 0), bound("max", 1), bound("max", 2)) == Vec3f(1e6f, 1.0f / 3, 1));

    using Rgba16 = std::array<std::uint16_t, 4>;
    CHECK(glb.scene["accessors"][attributes["COLOR_0"].get<int>()]["normalized"] == true);
    const auto colours = array<Rgba16>(glb, attributes["COLOR_0"], kUnsignedShort, "VEC4", kVertices);
    REQUIRE(colours.size() == mesh.colours.size());
    for (std::size_t v = 0; v < colours.size(); ++v) {
        CHECK(colours[v][3] == 65535);
        for (int c = 0; c < 3; ++c) {
            const double srgb = mesh.colours[v][c] / 255.0;  // IEC 61966-2-1
            const double linear = srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
            CHECK(colours[v][c] == Approx(65535 * linear).margin(0.6));
        }
    }
    const json& material = glb.scene["materials"][primitive["material"].get<int>()];
    CHECK(material["extensions"].contains("KHR_materials_unlit"));
    CHECK(glb.scene["extensionsUsed"] == json::array({"KHR_materials_unlit"}));
}

TEST_CASE("the root turns the world's up to glTF's, and positions stay", "[export]") {
    const TempDir folder;
    writeMesh(folder / "z.glb", smallMesh(), UpAxis::z);
    writeMesh(folder / "y.glb", smallMesh(), UpAxis::y);
    const Glb z = parse(readFile(folder / "z.glb")), y = parse(readFile(folder / "y.glb"));
    CHECK(y.binary == z.binary);
    CHECK_FALSE(y.scene["nodes"][0].contains("rotation"));
    const int scene = z.scene["scene"];
    const int root = z.scene["scenes"][scene]["nodes"][0];
    CHECK(z.scene["nodes"][root]["mesh"] == 0);
    const json& r = z.scene["nodes"][root]["rotation"];
    const Eigen::Quaterniond turn(r[3].get<double>(), r[0].get<double>(), r[1].get<double>(), r[2].get<double>());
    CHECK(turn.norm() == Approx(1));
    CHECK((turn * Vec3d::UnitZ() - Vec3d::UnitY()).norm() < 1e-12);
    CHECK((turn * Vec3d::UnitX() - Vec3d::UnitX()).norm() < 1e-12);
}

TEST_CASE("a bare mesh is a bare glTF file, one of nothing is refused", "[export]") {
    const TempDir folder;
    Mesh mesh = smallMesh();
    mesh.normals.clear();
    mesh.colours.clear();
    writeMesh(folder / "m.glb", mesh);
    const Glb glb = parse(readFile(folder / "m.glb"));
    CHECK(glb.scene["meshes"][0]["primitives"][0]["attributes"].size() == 1);
    CHECK_FALSE(glb.scene.contains("extensionsUsed"));
    CHECK_FALSE(glb.scene["materials"][0].contains("extensions"));
    CHECK_THROWS_WITH(writeMesh(folder / "none.glb", Mesh{}), Catch::Contains("no triangles"));
    CHECK_FALSE(std::filesystem::exists(folder / "none.glb"));
}
