// SPDX-License-Identifier: Apache-2.0
// Layout of model.vdb, version 4; what has no regions is written, and read, as version 3, which knew none. Version 2 had one
// shell and no sky, and is read. (In version 1 a ray's features were a sum, not a mean: it cannot be.)
//
// One grid a layer (shells.h), for everyone: "density" (shell 0), "density_1" and so on, what they halve once
// "density_half", "density_1_half", twice "density_quarter", float, fog volume, 1 / world unit, in
// voxels of twice the field's size, each the mean of eight (capped where a voxel is opaque). It is a preview: at full size it would be as large as all that was
// learned, and nothing here reads it; the model's own densities are among the learned values.
// Everything else is metadata of the file. Facts that people may want to read are plain numbers and strings:
//   nerfvdb_format          int32    4 or 3
//   nerfvdb_dims            vec3i    voxels per axis
//   nerfvdb_origin          vec3d    world position of voxel (0, 0, 0)
//   nerfvdb_voxel_size      double   world units
//   nerfvdb_shells          int32    how many, and for more than one: (shells.h)
//   nerfvdb_shell_extent    vec3i    cells of each along each axis
//   nerfvdb_shell_stride    int32    voxels from one to the next
//   nerfvdb_density_scale   double   sigma = density_scale * exp(min(raw, 15))
//   nerfvdb_background      vec3s    sRGB values
//   nerfvdb_channels        int32    features per voxel
//   nerfvdb_decoder_width   int32    of both hidden layers
//   nerfvdb_schedule string; nerfvdb_seed int64; nerfvdb_train_psnr double
// Learned values are bytes of the type "nerfvdb_bytes", little-endian:
//   nerfvdb_cells           cells of the topology (field_codec.h)
//   nerfvdb_regions         of each shell along each axis, int32 [3], and their halvings, uint8 [shell][x][y][z]; version 4
//   nerfvdb_values          raw density and features of active voxels (field_codec.h)
//   nerfvdb_decoder         float weights, in the order of Decoder::parameters()
//   nerfvdb_sky             learned panorama (sky.h); absent where there is none
//   nerfvdb_cameras         who photographed the scene (camera_codec.h); absent where nobody told
// The type is one that OpenVDB does not know, on purpose: for metadata (not for grids!) every program then keeps
// the bytes without looking inside, whereas a string of arbitrary bytes makes OpenVDB's Python module throw.
#include "vdb/model_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <type_traits>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/file_descriptor.h"
#include "core/parallel.h"
#include "vdb/camera_codec.h"
#include "vdb/field_codec.h"
#include "vdb/layer_cells.h"
#include "vdb/topology_tree.h"
#include "vdb/vdb_file.h"
#include "vdb/vdb_metadata.h"
#include "vdb/vdb_seal.h"

namespace nerfvdb {
namespace {

constexpr std::int32_t kFormat = 4, kFormatWithoutRegions = 3, kOldestFormat = 2;
constexpr const char* kBytesType = "nerfvdb_bytes";
// The name that tells a model from other files: of the facts that are no grid, the first (they stand in the order of
// names), and so near the start of every model.
constexpr const char* kMark = "nerfvdb_background";
constexpr int kMaxDims = 1 << 20;

static_assert(std::endian::native == std::endian::little, "weights are written as they lie in memory");

// ---- Saving ----

constexpr int kPreviewScale = 2;  // edge of a preview's voxel, field's voxels

/// A leaf of the preview from the up to eight leaves of the field that it covers: mean sigma as it will be after
/// loading, capped where opaque; active where any of the eight voxels is.
void fillPreview(const VoxelField& field, int layer, int step_exponent, const Vec3i& coord,
                 openvdb::FloatTree::LeafNodeType& preview) {
    constexpr float kShare = 1.0f / (kPreviewScale * kPreviewScale * kPreviewScale);
    const double scale = field.shells().layerScale(layer);
    const double voxel_size = field.frame().voxel_size * scale, density_scale = field.densityScale() / scale;
    for (int child = 0; child < 8; ++child) {
        const Vec3i octant(child >> 2, child >> 1 & 1, child & 1);
        const std::int32_t leaf = field.topology().findLeaf(coord * kPreviewScale + octant);
        if (leaf < 0) continue;
        forEachBit(field.topology().voxels()[leaf], [&](int offset) {
            const float raw = keptValue(field, leaf * std::size_t{kLeafVoxels} + offset, 0);
            const float sigma = volumeSigma(valueOf(codeOf(raw, step_exponent), step_exponent), density_scale, voxel_size);
            const Vec3i voxel(offset >> 6, offset >> 3 & 7, offset & 7);
            const Vec3i at = (octant * kLeafDim + voxel) / kPreviewScale;
            const int to = brickOffset(at.x(), at.y(), at.z());
            preview.setValueOn(to, preview.getValue(to) + sigma * kShare);
        });
    }
    const auto opaque = volumeSigma(kMaxRaw, density_scale, voxel_size * kPreviewScale);
    for (auto value = preview.beginValueOn(); value; ++value) value.setValue(std::min(*value, opaque));
}

/// Density for other programs. Half precision where that suffices, else float.
openvdb::FloatGrid::Ptr previewGrid(const VoxelField& field, int layer, int step_exponent) {
    const GridFrame fine = field.shells().frame(field.frame(), layer);
    const GridFrame frame{fine.origin + Vec3d::Constant(0.5 * (kPreviewScale - 1) * fine.voxel_size),
                          fine.voxel_size * kPreviewScale};
    auto grid = openvdb::FloatGrid::create(0.0f);
    std::vector<std::pair<Vec3i, openvdb::FloatTree::LeafNodeType*>> leaves;
    for (const Vec3i& coord : field.topology().leafCoords()) {
        if (field.shells().layerAt(coord.x() * kLeafDim) != layer) continue;
        const Vec3i to = coord / kPreviewScale;
        if (!grid->tree().probeLeaf(leafOrigin(to))) leaves.push_back({to, grid->tree().touchLeaf(leafOrigin(to))});
    }
    std::vector<float> largest(leaves.size(), 0.0f);
    parallelFor(leaves.size(), [&](std::size_t i) {
        fillPreview(field, layer, step_exponent, leaves[i].first, *leaves[i].second);
        for (auto value = leaves[i].second->cbeginValueOn(); value; ++value) largest[i] = std::max(largest[i], *value);
    });

    const int shell = field.shells().shellOf(layer);
    constexpr const char* kHalved[kMostHalvings + 1] = {"", "_half", "_quarter"};
    grid->setName((shell == 0 ? "density" : "density_" + std::to_string(shell)) + kHalved[field.shells().halvingsOf(layer)]);
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid->setTransform(gridTransform(frame));
    const float top = largest.empty() ? 0.0f : *std::max_element(largest.begin(), largest.end());
    grid->setSaveFloatAsHalf(halfSuffices(top, frame.voxel_size));
    return grid;
}

void insertBytes(openvdb::MetaMap& facts, const std::string& name, const std::string& bytes) {
    if (bytes.size() > 0xffffffffu)
        throw DataError(name, std::to_string(bytes.size()) + " bytes of learned values", "at most 4 GiB",
                        "the scene is too large for one model file: use a coarser grid or smaller bounds");
    openvdb::UnknownMetadata metadata(kBytesType);
    metadata.setValue(openvdb::UnknownMetadata::ByteVec(bytes.begin(), bytes.end()));
    facts.insertMeta(name, metadata);
}

std::string encodeRegions(const Regions& regions) {
    const std::int32_t dims[3] = {regions.dims.x(), regions.dims.y(), regions.dims.z()};
    std::string bytes(reinterpret_cast<const char*>(dims), sizeof dims);
    bytes.append(regions.halvings.begin(), regions.halvings.end());
    return bytes;
}

bool allCanBeStored(std::span<const float> values) {
    return std::all_of(values.begin(), values.end(), [](float value) { return canBeStored(value); });
}

void checkModel(const Model& model) {
    const VoxelField& field = model.field;
    const GridFrame& frame = field.frame();
    if (field.topology().dims().minCoeff() < kLeafDim || field.topology().dims().maxCoeff() > kMaxDims)
        throw UsageError("model", "a grid without voxels or more than 1048576 along an edge", "a grid to save");
    if (!frame.origin.allFinite() || !std::isfinite(frame.voxel_size) || frame.voxel_size <= 0)
        throw NumericError("model", "a grid frame that is not finite and positive", "world units");
    if (!(field.densityScale() > 0) || !std::isfinite(sigmaFromRaw(kMaxRaw, field.densityScale())))
        throw NumericError("model", "density scale " + std::to_string(field.densityScale()),
                           "a positive number that leaves sigma finite");
    if (field.channels() != model.decoder.channels())
        throw UsageError("model", std::to_string(field.channels()) + " features a voxel",
                         std::to_string(model.decoder.channels()) + " as the decoder reads");
    if (!allCanBeStored(model.decoder.parameters()) || !model.background.allFinite() || !allCanBeStored(model.sky.values()))
        throw NumericError("model", "NaN, infinity or more than a million in the decoder, the background or the sky",
                           "smaller numbers",
                           "training has diverged: nothing was saved");
}

// ---- Loading ----

/// Metadata of one file, by name; everything missing or of a wrong type is a DataError that names it.
class Facts {
public:
    /// Of a file's bytes, which must outlive it.
    Facts(std::span<const std::uint8_t> file, std::string path)
        : values_(readVdbMetadata(file, path)), path_(std::move(path)) {}

    std::string where(const std::string& name) const { return path_ + ": " + name; }
    bool has(const std::string& name) const { return values_.count(name) > 0; }

    template <typename T>
    T get(const std::string& name) const {
        const std::span<const std::uint8_t> bytes = bytesOf(name, openvdb::typeNameAsString<T>());
        if constexpr (std::is_same_v<T, std::string>) {
            return {bytes.begin(), bytes.end()};
        } else {
            T value;
            if (bytes.size() != sizeof value)
                throw DataError(where(name), std::to_string(bytes.size()) + " bytes", std::to_string(sizeof value));
            std::memcpy(&value, bytes.data(), sizeof value);
            return value;
        }
    }
    /// Learned values.
    std::span<const std::uint8_t> bytes(const std::string& name) const { return bytesOf(name, kBytesType); }

private:
    std::span<const std::uint8_t> bytesOf(const std::string& name, const std::string& type) const {
        const auto found = values_.find(name);
        if (found == values_.end() || found->second.type != type) throw DataError(where(name), "nothing", "a " + type);
        return found->second.bytes;
    }

    std::map<std::string, VdbValue> values_;
    std::string path_;
};

constexpr std::size_t kBeginning = 4096;  // bytes among which the mark stands

std::string readBeginning(const std::filesystem::path& path) {
    const PlainFile file(path);
    std::string bytes(kBeginning, '\0');
    bytes.resize(readAll(file.get(), std::as_writable_bytes(std::span(bytes)), path));
    return bytes;
}

/// All bytes of a model, which is intact before anything in it is looked at; else says what the file is instead.
std::string readIntact(const std::filesystem::path& path) {
    std::string bytes = readFile(path);
    const std::string_view beginning = std::string_view(bytes).substr(0, kBeginning);
    const bool marked = beginning.find(kMark) != std::string_view::npos;
    switch (checkVdbSeal(bytes)) {
        case VdbSeal::not_vdb:
            throw DataError(path.string(), bytes.empty() ? "an empty file" : "no .vdb file", "a model.vdb",
                            "give the file that `nerfvdb train --out` wrote");
        case VdbSeal::foreign:
            if (marked)
                throw DataError(path.string(), "a model that another program has written anew",
                                "the file as nerfvdb wrote it", "use the original: its checksum guards it");
            throw DataError(path.string(), "not a nerfvdb model: a .vdb of another program",
                            "a file that `nerfvdb train` wrote", "plain volumes carry no colours to render");
        case VdbSeal::broken:
            throw DataError(path.string(),
                            "damaged or truncated content (" + std::to_string(bytes.size()) +
                                " bytes that do not match the checksum)",
                            "an intact model", "copy the file again or train anew");
        case VdbSeal::intact:
            if (!marked)
                throw DataError(path.string(), "not a nerfvdb model: an exported volume without learned values",
                                "a model.vdb", "give the model that it was exported from");
    }
    return bytes;
}

Vec3i gridDims(const Facts& facts) {
    const openvdb::Vec3i stored = facts.get<openvdb::Vec3i>("nerfvdb_dims");
    const Vec3i dims(stored.x(), stored.y(), stored.z());
    if (dims.minCoeff() < kLeafDim || dims.maxCoeff() > kMaxDims)
        throw DataError(facts.where("nerfvdb_dims"), stored.str(), "8 to 1048576 voxels along each edge");
    return dims;
}

double positive(const Facts& facts, const std::string& name) {
    const double value = facts.get<double>(name);
    if (!std::isfinite(value) || value <= 0)
        throw DataError(facts.where(name), std::to_string(value), "a positive number");
    return value;
}

Decoder loadDecoder(const Facts& facts, int channels) {
    const std::int32_t width = facts.get<std::int32_t>("nerfvdb_decoder_width");
    if (width < 1 || width > kMaxDecoderWidth)
        throw DataError(facts.where("nerfvdb_decoder_width"), std::to_string(width),
                        "1 to " + std::to_string(kMaxDecoderWidth));
    Decoder decoder(channels, 0, width);
    const std::span<const std::uint8_t> bytes = facts.bytes("nerfvdb_decoder");
    const std::span<float> parameters = decoder.parameters();
    if (bytes.size() != parameters.size_bytes())
        throw DataError(facts.where("nerfvdb_decoder"), std::to_string(bytes.size()) + " bytes",
                        std::to_string(parameters.size_bytes()));
    std::memcpy(parameters.data(), bytes.data(), bytes.size());
    if (!allCanBeStored(parameters))
        throw DataError(facts.where("nerfvdb_decoder"), "NaN, infinity or more than a million", "weights as training makes them");
    return decoder;
}

std::shared_ptr<const Regions> loadRegions(const Facts& facts, int shells) {
    const std::span<const std::uint8_t> bytes = facts.bytes("nerfvdb_regions");
    std::int32_t dims[3] = {};
    if (bytes.size() >= sizeof dims) std::memcpy(dims, bytes.data(), sizeof dims);
    const std::span<const std::uint8_t> halvings = bytes.subspan(std::min(bytes.size(), sizeof dims));
    std::shared_ptr<const Regions> regions =
        makeRegions(shells, {dims[0], dims[1], dims[2]}, {halvings.begin(), halvings.end()});
    if (!regions)
        throw DataError(facts.where("nerfvdb_regions"), std::to_string(bytes.size()) + " bytes",
                        "how often cells are halved in each region of each shell, at most " +
                            std::to_string(kMostHalvings) + " times");
    return regions;
}

Shells loadShells(const Facts& facts, const Vec3i& dims) {
    Shells shells{1, dims - Vec3i::Ones(), 0};
    if (facts.get<std::int32_t>("nerfvdb_format") < 3) return shells;
    shells.count = facts.get<std::int32_t>("nerfvdb_shells");
    if (shells.count < 1 || shells.count > kMaxShells)
        throw DataError(facts.where("nerfvdb_shells"), std::to_string(shells.count), "1 to " + std::to_string(kMaxShells));
    if (shells.count == 1) return shells;
    const openvdb::Vec3i extent = facts.get<openvdb::Vec3i>("nerfvdb_shell_extent");
    shells.extent = Vec3i(extent.x(), extent.y(), extent.z());
    shells.stride = facts.get<std::int32_t>("nerfvdb_shell_stride");
    if (facts.get<std::int32_t>("nerfvdb_format") > kFormatWithoutRegions) shells.regions = loadRegions(facts, shells.count);
    if (!shells.fits(dims))
        throw DataError(facts.where("nerfvdb_shell_extent"), extent.str() + " every " + std::to_string(shells.stride),
                        "shells that fit into " + facts.get<openvdb::Vec3i>("nerfvdb_dims").str() + " voxels");
    return shells;
}

VoxelField loadField(const Facts& facts) {
    GridFrame frame;
    const openvdb::Vec3d origin = facts.get<openvdb::Vec3d>("nerfvdb_origin");
    frame.origin = Vec3d(origin.x(), origin.y(), origin.z());
    if (!frame.origin.allFinite()) throw DataError(facts.where("nerfvdb_origin"), origin.str(), "finite numbers");
    frame.voxel_size = positive(facts, "nerfvdb_voxel_size");
    const int channels = facts.get<std::int32_t>("nerfvdb_channels");
    if (channels != 4 && channels != 8 && channels != 16)
        throw DataError(facts.where("nerfvdb_channels"), std::to_string(channels), "4, 8 or 16");
    const Vec3i dims = gridDims(facts);
    VoxelField field(decodeTopology(dims, facts.bytes("nerfvdb_cells"), facts.where("nerfvdb_cells")), frame,
                     loadShells(facts, dims), channels, positive(facts, "nerfvdb_density_scale"));
    if (const std::string stray = strayLeaf(field.topology(), field.shells()); !stray.empty())
        throw DataError(facts.where("nerfvdb_cells"), stray, "cells in the shells and regions that the file tells of");
    decodeValues(facts.bytes("nerfvdb_values"), facts.where("nerfvdb_values"), field);
    return field;
}

}  // namespace

void saveModel(const Model& model, const std::filesystem::path& path) {
    checkModel(model);
    const VoxelField& field = model.field;
    const GridFrame& frame = field.frame();
    const std::span<const float> weights = model.decoder.parameters();
    const StepExponents steps = chooseSteps(model);

    openvdb::MetaMap facts;
    facts.insertMeta("creator", openvdb::StringMetadata("nerfvdb"));
    const Regions* const regions = field.shells().regions.get();
    facts.insertMeta("nerfvdb_format", openvdb::Int32Metadata(regions ? kFormat : kFormatWithoutRegions));
    facts.insertMeta("nerfvdb_dims", openvdb::Vec3IMetadata(openvdb::Vec3i(field.topology().dims().data())));
    facts.insertMeta("nerfvdb_origin", openvdb::Vec3DMetadata(openvdb::Vec3d(frame.origin.data())));
    facts.insertMeta("nerfvdb_voxel_size", openvdb::DoubleMetadata(frame.voxel_size));
    facts.insertMeta("nerfvdb_shells", openvdb::Int32Metadata(field.shells().count));
    if (field.shells().count > 1) {
        facts.insertMeta("nerfvdb_shell_extent", openvdb::Vec3IMetadata(openvdb::Vec3i(field.shells().extent.data())));
        facts.insertMeta("nerfvdb_shell_stride", openvdb::Int32Metadata(field.shells().stride));
    }
    facts.insertMeta("nerfvdb_density_scale", openvdb::DoubleMetadata(field.densityScale()));
    facts.insertMeta("nerfvdb_background", openvdb::Vec3SMetadata(openvdb::Vec3s(model.background.data())));
    facts.insertMeta("nerfvdb_channels", openvdb::Int32Metadata(field.channels()));
    facts.insertMeta("nerfvdb_decoder_width", openvdb::Int32Metadata(model.decoder.width()));
    facts.insertMeta("nerfvdb_schedule", openvdb::StringMetadata(model.info.schedule));
    facts.insertMeta("nerfvdb_seed", openvdb::Int64Metadata(static_cast<std::int64_t>(model.info.seed)));
    facts.insertMeta("nerfvdb_train_psnr", openvdb::DoubleMetadata(model.info.train_psnr));
    if (regions) insertBytes(facts, "nerfvdb_regions", encodeRegions(*regions));
    insertBytes(facts, "nerfvdb_cells", encodeTopology(field.topology()));
    insertBytes(facts, "nerfvdb_values", encodeValues(field, steps));
    insertBytes(facts, "nerfvdb_decoder", {reinterpret_cast<const char*>(weights.data()), weights.size_bytes()});
    if (!model.sky.isEmpty()) insertBytes(facts, "nerfvdb_sky", model.sky.encode());
    if (!model.cameras.empty()) insertBytes(facts, "nerfvdb_cameras", encodeCameras(model.cameras));
    openvdb::initialize();
    openvdb::GridCPtrVec previews;
    for (int layer = 0; layer < field.shells().layerCount(); ++layer) {
        previews.push_back(previewGrid(field, layer, steps[0]));
        if (field.shells().halvingsOf(layer) > 0 && previews.back()->empty()) previews.pop_back();
    }
    writeVdb(path, previews, facts);
}

Model loadModel(const std::filesystem::path& path) {
    const std::string file = readIntact(path);
    const Facts facts({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()}, path.string());
    if (const auto format = facts.get<std::int32_t>("nerfvdb_format"); format < kOldestFormat || format > kFormat)
        throw DataError(facts.where("nerfvdb_format"), std::to_string(format), std::to_string(kFormat),
                        format > kFormat ? "a newer nerfvdb wrote this model: update this program"
                                         : "an older nerfvdb wrote this model: use that one, or train anew");
    Model model;
    model.field = loadField(facts);
    model.decoder = loadDecoder(facts, model.field.channels());
    const openvdb::Vec3s background = facts.get<openvdb::Vec3s>("nerfvdb_background");
    model.background = Vec3f(background.x(), background.y(), background.z());
    if (!model.background.allFinite())
        throw DataError(facts.where("nerfvdb_background"), "NaN or infinity", "three numbers");
    model.info.schedule = facts.get<std::string>("nerfvdb_schedule");
    model.info.seed = static_cast<std::uint64_t>(facts.get<std::int64_t>("nerfvdb_seed"));
    model.info.train_psnr = facts.get<double>("nerfvdb_train_psnr");
    if (facts.has("nerfvdb_sky")) model.sky = Sky::decode(facts.bytes("nerfvdb_sky"), facts.where("nerfvdb_sky"));
    if (facts.has("nerfvdb_cameras"))
        model.cameras = decodeCameras(facts.bytes("nerfvdb_cameras"), facts.where("nerfvdb_cameras"));
    return model;
}

namespace {

GridFacts factsOf(const openvdb::GridBase& grid) {
    GridFacts facts;
    facts.name = grid.getName();
    facts.type = grid.valueType();
    facts.grid_class = openvdb::GridBase::gridClassToMenuName(grid.getGridClass());
    std::transform(facts.grid_class.begin(), facts.grid_class.end(), facts.grid_class.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 'a' - 'A') : c; });
    facts.active_voxels = grid.activeVoxelCount();
    facts.voxel_size = Vec3d(grid.voxelSize().asPointer());
    const openvdb::CoordBBox voxels = grid.evalActiveVoxelBoundingBox();
    if (voxels.empty()) return facts;
    facts.dims = Vec3i(voxels.dim().asPointer());
    // OpenVDB's values sit at integer coordinates, in the middle of their cubes.
    const openvdb::BBoxd world = grid.transform().indexToWorld(
        openvdb::BBoxd(voxels.min().asVec3d() - openvdb::Vec3d(0.5), voxels.max().asVec3d() + openvdb::Vec3d(0.5)));
    facts.bounds = {Vec3d(world.min().asPointer()), Vec3d(world.max().asPointer())};
    return facts;
}

}  // namespace

std::vector<GridFacts> listGrids(const std::filesystem::path& path) {
    const VdbContent file = readVdb(path);
    std::vector<GridFacts> grids;
    for (const openvdb::GridBase::Ptr& grid : *file.grids) grids.push_back(factsOf(*grid));
    return grids;
}

bool isModelFile(const std::filesystem::path& path) {
    return readBeginning(path).find(kMark) != std::string::npos && isVdbFile(path);
}

bool isVdbFile(const std::filesystem::path& path) { return hasVdbMagic(readBeginning(path)); }

bool isForeignVdbFile(const std::filesystem::path& path) { return isForeignVdb(readBeginning(path)); }

}  // namespace nerfvdb
