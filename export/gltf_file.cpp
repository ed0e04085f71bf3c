// SPDX-License-Identifier: Apache-2.0
#include "export/gltf_file.h"

#include <tiny_gltf.h>

#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <numbers>

#include "core/error.h"
#include "core/image.h"

namespace nerfvdb {
namespace {

using Rgba16 = std::array<std::uint16_t, 4>;

std::vector<Rgba16> linearColours(const Mesh& mesh) {
    std::array<std::uint16_t, 256> linear;
    for (int i = 0; i < 256; ++i)
        linear[i] = static_cast<std::uint16_t>(std::lround(65535 * linearFromSrgb(static_cast<float>(i) / 255)));
    std::vector<Rgba16> colours(mesh.colours.size());
    for (std::size_t v = 0; v < colours.size(); ++v) {
        const Rgb8& c = mesh.colours[v];
        colours[v] = {linear[c[0]], linear[c[1]], linear[c[2]], 65535};
    }
    return colours;
}

/// One glTF model whose buffer grows by one array after another.
class GltfArrays {
public:
    explicit GltfArrays(tinygltf::Model& model, std::size_t bytes) : model_(model) {
        model_.buffers.resize(1);
        model_.buffers[0].data.reserve(bytes);
    }

    /// Appends an array of 4-byte aligned items; returns the number of its accessor.
    template <typename T>
    int add(const std::vector<T>& items, int target, int component_type, int type, std::size_t per_item = 1) {
        static_assert(sizeof(T) % 4 == 0);
        std::vector<unsigned char>& bytes = model_.buffers[0].data;
        tinygltf::BufferView view;
        view.buffer = 0;
        view.byteOffset = bytes.size();
        view.byteLength = items.size() * sizeof(T);
        view.target = target;
        bytes.resize(view.byteOffset + view.byteLength);
        std::memcpy(bytes.data() + view.byteOffset, items.data(), view.byteLength);

        tinygltf::Accessor accessor;
        accessor.bufferView = static_cast<int>(model_.bufferViews.size());
        accessor.componentType = component_type;
        accessor.type = type;
        accessor.count = items.size() * per_item;
        model_.bufferViews.push_back(view);
        model_.accessors.push_back(accessor);
        return accessor.bufferView;
    }

private:
    tinygltf::Model& model_;
};

/// glTF demands the box of positions.
void addBounds(tinygltf::Accessor& accessor, const std::vector<Vec3f>& positions) {
    Vec3f low = positions[0], high = positions[0];
    for (const Vec3f& p : positions) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
    }
    accessor.minValues.assign(low.begin(), low.end());
    accessor.maxValues.assign(high.begin(), high.end());
}

tinygltf::Material matt(bool has_colours) {
    tinygltf::Material material;
    material.pbrMetallicRoughness.metallicFactor = 0;
    if (has_colours) material.extensions["KHR_materials_unlit"] = tinygltf::Value(tinygltf::Value::Object());
    return material;
}

tinygltf::Node rootNode(UpAxis up) {
    tinygltf::Node node;
    node.name = "nerfvdb";
    node.mesh = 0;
    // A quarter turn about x that brings z to y; a quaternion x, y, z, w.
    if (up == UpAxis::z) node.rotation = {-std::numbers::sqrt2 / 2, 0, 0, std::numbers::sqrt2 / 2};
    return node;
}

tinygltf::Model gltfOf(const Mesh& mesh, UpAxis up, std::size_t bytes) {
    tinygltf::Model model;
    model.asset.version = "2.0";
    model.asset.generator = "nerfvdb";
    GltfArrays arrays(model, bytes);
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    const int positions =
        arrays.add(mesh.positions, TINYGLTF_TARGET_ARRAY_BUFFER, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3);
    addBounds(model.accessors[positions], mesh.positions);
    primitive.attributes["POSITION"] = positions;
    if (!mesh.normals.empty())
        primitive.attributes["NORMAL"] =
            arrays.add(mesh.normals, TINYGLTF_TARGET_ARRAY_BUFFER, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3);
    if (!mesh.colours.empty()) {
        const int colours = arrays.add(linearColours(mesh), TINYGLTF_TARGET_ARRAY_BUFFER,
                                       TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC4);
        model.accessors[colours].normalized = true;
        primitive.attributes["COLOR_0"] = colours;
        model.extensionsUsed.push_back("KHR_materials_unlit");
    }
    primitive.indices = arrays.add(mesh.triangles, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER,
                                   TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR, /*per_item=*/3);
    primitive.material = 0;
    model.materials.push_back(matt(!mesh.colours.empty()));
    model.meshes.resize(1);
    model.meshes[0].primitives.push_back(primitive);
    model.nodes.push_back(rootNode(up));
    model.scenes.resize(1);
    model.scenes[0].nodes.push_back(0);
    model.defaultScene = 0;
    return model;
}

}  // namespace

void writeGlb(const std::filesystem::path& temporary, const std::filesystem::path& path, const Mesh& mesh, UpAxis up) {
    constexpr std::size_t kHeaders = 1 << 16;  // more than the JSON part ever takes
    const std::size_t bytes = mesh.positions.size() * 12 + mesh.normals.size() * 12 +
                              mesh.colours.size() * sizeof(Rgba16) + mesh.triangles.size() * 12;
    if (mesh.triangles.empty()) throw DataError("mesh", "no triangles", "at least one, as glTF does");
    if (bytes > std::numeric_limits<std::uint32_t>::max() - kHeaders)
        throw DataError("mesh", std::to_string(bytes) + " bytes", "less than 4 GiB, the most that .glb can hold",
                        "simplify the mesh, or write .ply");
    const tinygltf::Model model = gltfOf(mesh, up, bytes);
    std::ofstream stream(temporary, std::ios::binary);
    tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, stream, /*prettyPrint=*/false, /*writeBinary=*/true);
    stream.close();
    if (!stream) throw IoError(path.string(), "a failed write", "room for the mesh", "is the disk full?");
}

}  // namespace nerfvdb
