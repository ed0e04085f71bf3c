// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_io.h"

#include <Eigen/Geometry>
#include <cstring>
#include <fstream>
#include <sstream>

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/meshing.h"
#include "tests/support/small_disk.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;

namespace {

Mesh smallMesh() {
    Mesh mesh;
    mesh.positions = {{0.1f, -2, 3e-7f}, {1, 0, 0}, {0, 1.0f / 3, 0}, {1e6f, 0, 1}};
    mesh.normals = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}, {0.6f, 0, -0.8f}};
    mesh.colours = {
        {0, 1, 2}, {255, 254, 253}, {10, 13, 26}, {128, 0, 255}};  // 10, 13, 26: as text they would hurt
    mesh.triangles = {{0, 1, 2}, {3, 2, 1}};
    return mesh;
}

void writeBytes(const std::filesystem::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
}

}  // namespace

TEST_CASE("a PLY file holds what the mesh holds", "[export]") {
    const TempDir folder;
    const Mesh mesh = smallMesh();
    writeMesh(folder / "m.ply", mesh);
    const Mesh read = readPly(folder / "m.ply");
    CHECK(read.positions == mesh.positions);
    CHECK(read.normals == mesh.normals);
    CHECK(read.colours == mesh.colours);
    CHECK(read.triangles == mesh.triangles);

    const std::string bytes = readFile(folder / "m.ply");
    const std::string header =
        "ply\nformat binary_little_endian 1.0\ncomment nerfvdb\nelement vertex 4\n"
        "property float x\nproperty float y\nproperty float z\n"
        "property float nx\nproperty float ny\nproperty float nz\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    REQUIRE(bytes.size() == header.size() + 4 * (12 + 12 + 3) + 2 * (1 + 12));
    CHECK(bytes.substr(0, header.size()) == header);
    CHECK(bytes.substr(bytes.size() - 13) == std::string("\3\3\0\0\0\2\0\0\0\1\0\0\0", 13));
}

TEST_CASE("normals and colours may be absent", "[export]") {
    const TempDir folder;
    Mesh mesh = smallMesh();
    mesh.normals.clear();
    mesh.colours.clear();
    writeMesh(folder / "m.PLY", mesh);
    const Mesh read = readPly(folder / "m.PLY");
    CHECK(read.positions == mesh.positions);
    CHECK(read.normals.empty());
    CHECK(read.colours.empty());
    writeMesh(folder / "m.obj", mesh);
    CHECK(readFile(folder / "m.obj") ==
          "# nerfvdb\nv 0.1 -2 3e-07\nv 1 0 0\nv 0 0.33333334 0\nv 1e+06 0 1\nf 1 2 3\nf 4 3 2\n");
}

TEST_CASE("an OBJ file reads back to the same floats", "[export]") {
    const TempDir folder;
    const Mesh mesh = smallMesh();
    writeMesh(folder / "m.obj", mesh);
    std::istringstream lines(readFile(folder / "m.obj"));
    std::size_t n_vertices = 0, n_normals = 0, n_faces = 0;
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string word;
        words >> word;
        if (word == "v") {
            Vec3f position, colour;
            words >> position[0] >> position[1] >> position[2] >> colour[0] >> colour[1] >> colour[2];
            REQUIRE(words);
            CHECK(position == mesh.positions[n_vertices]);
            CHECK(Vec3f(mesh.colours[n_vertices].cast<float>() / 255.0f) == colour);
            ++n_vertices;
        } else if (word == "vn") {
            Vec3f normal;
            words >> normal[0] >> normal[1] >> normal[2];
            CHECK(normal == mesh.normals[n_normals++]);
        } else if (word == "f") {
            ++n_faces;
        }
    }
    CHECK(n_vertices == 4);
    CHECK(n_normals == 4);
    CHECK(n_faces == 2);
    CHECK(readFile(folder / "m.obj").find("f 4//4 3//3 2//2\n") != std::string::npos);
}

TEST_CASE("an STL file holds corners and normals of the triangles", "[export]") {
    const TempDir folder;
    const Mesh mesh = smallMesh();
    writeMesh(folder / "m.stl", mesh);
    const std::string bytes = readFile(folder / "m.stl");
    REQUIRE(bytes.size() == 80 + 4 + 2 * 50);
    CHECK(bytes.substr(0, 5) != "solid");
    CHECK(bytes.substr(80, 4) == std::string("\2\0\0\0", 4));
    for (std::size_t i = 0; i < 2; ++i) {
        Vec3f values[4];
        std::memcpy(values[0].data(), bytes.data() + 84 + 50 * i, 48);
        const Triangle& t = mesh.triangles[i];
        for (int k = 0; k < 3; ++k) CHECK(values[1 + k] == mesh.positions[t[k]]);
        const Vec3f normal = (values[2] - values[1]).cross(values[3] - values[1]).normalized();
        CHECK((values[0] - normal).norm() < 1e-5f);
        CHECK(bytes.substr(84 + 50 * i + 48, 2) == std::string(2, '\0'));
    }
    Mesh flat = mesh;
    flat.triangles = {{0, 0, 1}};
    writeMesh(folder / "flat.stl", flat);
    Vec3f normal;
    std::memcpy(normal.data(), readFile(folder / "flat.stl").data() + 84, 12);
    CHECK(normal == Vec3f::Zero());  // and no NaN
}

TEST_CASE("an unknown extension is a wrong use that names the known ones", "[export]") {
    const TempDir folder;
    CHECK(meshFormat("scene.STL") == MeshFormat::stl);
    CHECK(meshFormat("scene.glb") == MeshFormat::glb);
    CHECK_THROWS_AS(meshFormat("scene.gltf"), UsageError);
    CHECK_THROWS_WITH(writeMesh(folder / "scene.fbx", smallMesh()),
                      Catch::Contains(".ply, .obj, .stl or .glb") && Catch::Contains("\".fbx\""));
    CHECK_THROWS_WITH(writeMesh(folder / "scene", smallMesh()), Catch::Contains("no extension"));
    CHECK(std::filesystem::is_empty(folder.path()));
}

TEST_CASE("a file that cannot be written leaves the old one as it was", "[export]") {
    const TempDir folder;
    for (const char* name : {"m.ply", "m.obj", "m.stl", "m.glb"}) {
        writeBytes(folder / name, "old");
        Mesh mesh = smallMesh();
        for (int i = 0; i < 10000; ++i) mesh.triangles.push_back({0, 1, 2});
        {
            const SmallDisk full_disk(50000);
            CHECK_THROWS_AS(writeMesh(folder / name, mesh), IoError);
            CHECK_THROWS_WITH(writeMesh(folder / name, mesh),
                              Catch::StartsWith((folder / name).string() + ": found a failed write, expected room"));
        }
        CHECK(readFile(folder / name) == "old");
    }
    CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 4);  // no temporary stays
    CHECK_THROWS_AS(writeMesh(folder / "absent" / "m.ply", smallMesh()), IoError);
}

TEST_CASE("a mesh at odds with itself is not written", "[export]") {
    const TempDir folder;
    Mesh mesh = smallMesh();
    mesh.normals.pop_back();
    CHECK_THROWS_AS(writeMesh(folder / "m.ply", mesh), DataError);
    mesh = smallMesh();
    mesh.triangles[1][0] = 4;
    CHECK_THROWS_WITH(writeMesh(folder / "m.ply", mesh), Catch::Contains("vertex 4"));
}

TEST_CASE("a damaged PLY file is an error", "[export]") {
    const TempDir folder;
    const auto path = folder / "m.ply";
    writeMesh(path, smallMesh());
    const std::string good = readFile(path);
    const auto reads = [&](const std::string& bytes) {
        writeBytes(path, bytes);
        readPly(path);
    };
    CHECK_THROWS_WITH(reads(good.substr(0, good.size() - 1)), Catch::Contains("truncated"));
    CHECK_THROWS_AS(reads(good.substr(0, 40)), DataError);
    CHECK_THROWS_AS(reads("solid"), DataError);
    CHECK_THROWS_AS(reads(""), DataError);
    const auto with = [&](std::string from, const std::string& to) {
        std::string bytes = good;
        return bytes.replace(bytes.find(from), from.size(), to);
    };
    CHECK_THROWS_WITH(reads(with("binary_little_endian", "ascii")), Catch::Contains("ascii"));
    CHECK_THROWS_AS(reads(with("vertex 4", "vertex 99999999999999999")), DataError);
    CHECK_THROWS_AS(reads(with("vertex 4", "vertex -4")), DataError);
    CHECK_THROWS_AS(reads(with("property float x", "property quark x")), DataError);
    std::string bytes = good;
    bytes[bytes.size() - 13] = 4;  // corners of the last face
    CHECK_THROWS_WITH(reads(bytes), Catch::Contains("4 corners"));
    bytes = good;
    bytes[bytes.size() - 12] = 9;
    CHECK_THROWS_WITH(reads(bytes), Catch::Contains("vertex 9"));
    CHECK_THROWS_AS(readPly(folder / "absent.ply"), IoError);
}

TEST_CASE("a stream of parts is the file of the whole mesh", "[export]") {
    // One voxel inside of each leaf: more blocks than one part holds, and few triangles in each.
    constexpr int kDim = 21 * kLeafDim, kChannels = 4;
    const auto isNear = [](const Vec3i& c) {
        return (c.x() & 7) >= 6 && (c.y() & 7) >= 6 && (c.z() & 7) >= 6;
    };
    Model model;
    Topology topology = test::makeTopology(Vec3i::Constant(kDim), Vec3i::Zero(), Vec3i::Constant(kDim - 1), isNear);
    model.field = VoxelField(std::move(topology), {}, kChannels, 1.0);
    model.decoder = Decoder(kChannels, 7);
    test::forEachVoxel(model.field.topology(), [&](const Vec3i& p, std::size_t i) {
        model.field.density()[i] = p.unaryExpr([](int c) { return c & 7; }) == Vec3i(7, 7, 7) ? 1.0f : -1.0f;
        model.field.features()[i * kChannels] = 0.01f * static_cast<float>(p.x());
    });
    const TempDir folder;
    Report silent;
    MeshOptions options{.iso = 1.0};
    for (const bool colours : {true, false}) {
        options.colours = colours;
        const Mesh mesh = extractSurface(model, options, silent);
        CHECK(mesh.triangles.size() > 8 * 8192);
        writeMesh(folder / "whole.ply", mesh);
        streamPly(folder / "parts.ply", model, options, silent);
        CHECK(readFile(folder / "parts.ply") == readFile(folder / "whole.ply"));
    }
    CHECK_THROWS_AS(streamPly(folder / "parts.obj", model, options, silent), UsageError);
    MeshOptions dual = options;
    dual.method = SurfaceMethod::dual;
    CHECK_THROWS_AS(streamPly(folder / "dual.ply", model, dual, silent), UsageError);
    MeshOptions nowhere = options;
    nowhere.bounds = Box{Vec3d::Constant(1), Vec3d::Constant(3)};
    CHECK_THROWS_AS(streamPly(folder / "nowhere.ply", model, nowhere, silent), NumericError);
    CHECK(!std::filesystem::exists(folder / "dual.ply"));
    CHECK(!std::filesystem::exists(folder / "nowhere.ply"));
}
