// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_io.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cctype>
#include <charconv>
#include <cstring>
#include <fstream>
#include <limits>
#include <span>
#include <string>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/ply_header.h"
#include "export/gltf_file.h"

namespace nerfvdb {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY is written as memory holds it");

/// A file written through a buffer of its own; any failure is an IoError that names what the user asked for.
class Output {
public:
    Output(const std::filesystem::path& temporary, const std::filesystem::path& path)
        : path_(path), stream_(temporary, std::ios::binary) {
        buffer_.reserve(kFlushAt + kMostAtOnce);
        check();
    }
    void text(std::string_view s) {
        for (; s.size() > kMostAtOnce; s.remove_prefix(kMostAtOnce)) append(s.data(), kMostAtOnce);
        append(s.data(), s.size());
    }
    template <typename T>
    void bytes(const T* values, std::size_t n) {
        append(reinterpret_cast<const char*>(values), n * sizeof(T));
    }
    template <typename T>
    void number(T value) {
        char digits[32];
        append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr - digits);
    }
    void close() {
        flush();
        stream_.close();
        check();
    }

private:
    static constexpr std::size_t kFlushAt = std::size_t{1} << 20, kMostAtOnce = 4096;

    void append(const char* data, std::size_t size) {
        buffer_.append(data, size);
        if (buffer_.size() >= kFlushAt) flush();
    }
    void flush() {
        stream_.write(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
        buffer_.clear();
        check();
    }
    void check() const {
        if (!stream_) throw IoError(path_.string(), "a failed write", "room for the mesh", "is the disk full?");
    }

    const std::filesystem::path& path_;
    std::ofstream stream_;
    std::string buffer_;
};

std::string extensionOf(const std::filesystem::path& path) {
    std::string extension = path.extension().string();
    for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return extension;
}

void checkMesh(const Mesh& mesh) {
    const auto check = [&](std::size_t found, const char* what) {
        if (found != 0 && found != mesh.positions.size())
            throw DataError(std::string("mesh: ") + what, std::to_string(found),
                            "one per vertex (" + std::to_string(mesh.positions.size()) + ") or none");
    };
    check(mesh.normals.size(), "normals");
    check(mesh.colours.size(), "colours");
    constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max();
    if (mesh.positions.size() > kMost || mesh.triangles.size() > kMost)
        throw DataError("mesh", std::to_string(mesh.positions.size()) + " vertices",
                        "at most " + std::to_string(kMost));
    checkTriangles(mesh);
}

void writePlyHeader(Output& out, std::size_t vertices, std::size_t triangles, bool has_normals, bool has_colours) {
    out.text("ply\nformat binary_little_endian 1.0\ncomment nerfvdb\n");
    out.text("element vertex " + std::to_string(vertices) + "\n");
    for (const char* name : {"x", "y", "z"}) out.text(std::string("property float ") + name + "\n");
    if (has_normals)
        for (const char* name : {"nx", "ny", "nz"}) out.text(std::string("property float ") + name + "\n");
    if (has_colours)
        for (const char* name : {"red", "green", "blue"})
            out.text(std::string("property uchar ") + name + "\n");
    out.text("element face " + std::to_string(triangles) + "\n");
    out.text("property list uchar int vertex_indices\nend_header\n");
}

void writePlyVertices(Output& out, const Mesh& mesh) {
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        out.bytes(mesh.positions[v].data(), 3);
        if (!mesh.normals.empty()) out.bytes(mesh.normals[v].data(), 3);
        if (!mesh.colours.empty()) out.bytes(mesh.colours[v].data(), 3);
    }
}

void writePlyTriangles(Output& out, std::span<const Triangle> triangles) {
    constexpr std::uint8_t kCorners = 3;
    for (const Triangle& t : triangles) {
        out.bytes(&kCorners, 1);
        out.bytes(t.data(), 3);
    }
}

void writePly(Output& out, const Mesh& mesh) {
    writePlyHeader(out, mesh.positions.size(), mesh.triangles.size(), !mesh.normals.empty(), !mesh.colours.empty());
    writePlyVertices(out, mesh);
    writePlyTriangles(out, mesh.triangles);
}

class PlySink final : public MeshSink {
public:
    PlySink(Output& out, bool has_colours) : out_(out), has_colours_(has_colours) {}
    void begin(std::size_t vertices, std::size_t triangles) override {
        writePlyHeader(out_, vertices, triangles, true, has_colours_);
    }
    void addVertices(const Mesh& part) override { writePlyVertices(out_, part); }
    void addTriangles(std::span<const Triangle> part) override { writePlyTriangles(out_, part); }

private:
    Output& out_;
    bool has_colours_;
};

void writeObj(Output& out, const Mesh& mesh) {
    const auto line = [&](const char* word, const auto& vector) {
        out.text(word);
        for (int c = 0; c < 3; ++c) {
            out.text(" ");
            out.number(vector[c]);
        }
    };
    out.text("# nerfvdb\n");
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        line("v", mesh.positions[v]);
        if (!mesh.colours.empty()) line("", Vec3f(mesh.colours[v].cast<float>() / 255.0f));
        out.text("\n");
    }
    for (const Vec3f& normal : mesh.normals) {
        line("vn", normal);
        out.text("\n");
    }
    for (const Triangle& t : mesh.triangles) {
        out.text("f");
        for (int c = 0; c < 3; ++c) {
            out.text(" ");
            out.number(t[c] + 1);
            if (mesh.normals.empty()) continue;
            out.text("//");
            out.number(t[c] + 1);
        }
        out.text("\n");
    }
}

void writeStl(Output& out, const Mesh& mesh) {
    // Must not begin with "solid", by which readers tell the text format.
    std::string header = "nerfvdb, binary STL";
    header.resize(80, ' ');
    out.text(header);
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    out.bytes(&count, 1);
    constexpr std::uint16_t kAttributes = 0;
    for (const Triangle& t : mesh.triangles) {
        const Vec3d a = mesh.positions[t[0]].cast<double>();
        const Vec3d b = mesh.positions[t[1]].cast<double>(), c = mesh.positions[t[2]].cast<double>();
        const Vec3f normal = (b - a).cross(c - a).normalized().cast<float>();
        out.bytes(normal.data(), 3);
        for (int k = 0; k < 3; ++k) out.bytes(mesh.positions[t[k]].data(), 3);
        out.bytes(&kAttributes, 1);
    }
}

/// Bytes of a vertex before three properties in a row of the given size, or -1 if they are not there.
std::ptrdiff_t offsetOf(const PlyElement& vertex, std::size_t type_size, const std::array<const char*, 3>& names) {
    const int first = vertex.find(names[0]);
    for (int k = 0; k < 3; ++k) {
        const int property = vertex.find(names[static_cast<std::size_t>(k)]);
        if (property < 0 || property != first + k || vertex.properties[static_cast<std::size_t>(property)].size != type_size) return -1;
    }
    return static_cast<std::ptrdiff_t>(vertex.offset(first));
}

/// Throws DataError unless the file is vertices without lists, then triangles as our own files have them.
void checkTriangles(const std::string& where, const PlyHeader& header) {
    if (header.is_text) throw DataError(where + ": format", "ascii", "binary_little_endian");
    const auto isList = [](const PlyProperty& p) { return p.isList(); };
    const bool is_mesh = header.elements.size() == 2 && header.elements[0].name == "vertex" && header.elements[1].name == "face";
    if (!is_mesh || std::any_of(header.elements[0].properties.begin(), header.elements[0].properties.end(), isList))
        throw DataError(where + ": header", "other elements", "\"element vertex N\" of plain numbers, then \"element face N\"");
    const std::vector<PlyProperty>& face = header.elements[1].properties;
    if (face.size() != 1 || !face[0].isList() || plyTypeSize(face[0].count_type) != 1 || face[0].size != 4)
        throw DataError(where + ": header", "other properties of faces", "\"property list uchar int vertex_indices\"");
}

}  // namespace

MeshFormat meshFormat(const std::filesystem::path& path) {
    const std::string extension = extensionOf(path);
    if (extension == ".ply") return MeshFormat::ply;
    if (extension == ".obj") return MeshFormat::obj;
    if (extension == ".stl") return MeshFormat::stl;
    if (extension == ".glb") return MeshFormat::glb;
    throw UsageError(path.string(), extension.empty() ? "no extension" : "extension \"" + extension + "\"",
                     ".ply, .obj, .stl or .glb", "the extension chooses the mesh format");
}

void writeMesh(const std::filesystem::path& path, const Mesh& mesh, UpAxis up) {
    const MeshFormat format = meshFormat(path);
    checkMesh(mesh);
    writeAtomically(path, [&](const std::filesystem::path& temporary) {
        if (format == MeshFormat::glb) return writeGlb(temporary, path, mesh, up);
        Output out(temporary, path);
        if (format == MeshFormat::ply) writePly(out, mesh);
        if (format == MeshFormat::obj) writeObj(out, mesh);
        if (format == MeshFormat::stl) writeStl(out, mesh);
        out.close();
    });
}

void streamPly(const std::filesystem::path& path, const Model& model, const MeshOptions& options, Report& report) {
    if (extensionOf(path) != ".ply")
        throw UsageError(path.string(), "a format that is not made part by part", ".ply", "or mesh without a stream");
    writeAtomically(path, [&](const std::filesystem::path& temporary) {
        Output out(temporary, path);
        PlySink sink(out, options.colours);
        streamSurface(model, options, sink, report);
        out.close();
    });
}

Mesh readPly(const std::filesystem::path& path) {
    const std::string where = path.string();
    const std::string bytes = readFile(path);
    const PlyHeader header = parsePlyHeader(where, bytes);
    checkTriangles(where, header);
    const PlyElement& vertex = header.elements[0];
    const std::size_t n_vertices = vertex.count, n_faces = header.elements[1].count, vertex_size = vertex.size();
    constexpr std::size_t kFaceSize = 1 + 3 * sizeof(std::int32_t);

    const std::size_t body = bytes.size() - header.end;
    // Divided, not multiplied: a count in a damaged header must not overflow.
    if (vertex_size == 0 || n_vertices > body / vertex_size || n_faces != (body - n_vertices * vertex_size) / kFaceSize ||
        (body - n_vertices * vertex_size) % kFaceSize != 0)
        throw DataError(where, std::to_string(body) + " bytes after the header",
                        std::to_string(n_vertices) + " vertices and " + std::to_string(n_faces) + " triangles",
                        "the file is truncated or its faces are not triangles");
    const std::ptrdiff_t position = offsetOf(vertex, 4, {"x", "y", "z"});
    const std::ptrdiff_t normal = offsetOf(vertex, 4, {"nx", "ny", "nz"});
    const std::ptrdiff_t colour = offsetOf(vertex, 1, {"red", "green", "blue"});
    if (position < 0) throw DataError(where, "vertices without float x y z", "a mesh");

    Mesh mesh;
    mesh.positions.resize(n_vertices);
    if (normal >= 0) mesh.normals.resize(n_vertices);
    if (colour >= 0) mesh.colours.resize(n_vertices);
    mesh.triangles.resize(n_faces);
    const char* from = bytes.data() + header.end;
    for (std::size_t v = 0; v < n_vertices; ++v, from += vertex_size) {
        std::memcpy(mesh.positions[v].data(), from + position, 12);
        if (normal >= 0) std::memcpy(mesh.normals[v].data(), from + normal, 12);
        if (colour >= 0) std::memcpy(mesh.colours[v].data(), from + colour, 3);
    }
    for (Triangle& triangle : mesh.triangles) {
        if (*from != 3)
            throw DataError(where, "a face of " + std::to_string(int{*from}) + " corners", "triangles");
        std::memcpy(triangle.data(), from + 1, 12);
        if (triangle.maxCoeff() >= n_vertices)
            throw DataError(where, "vertex " + std::to_string(triangle.maxCoeff()) + " in a face",
                            "a number below " + std::to_string(n_vertices));
        from += kFaceSize;
    }
    return mesh;
}

}  // namespace nerfvdb
