// SPDX-License-Identifier: Apache-2.0
// Files that are no models, or no longer, or not for this program: refused with the reason.
#include <cmath>
#include <cstring>
#include <fstream>
#include <iostream>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/catch.h"
#include "tests/support/nested_field.h"
#include "tests/support/shell_model.h"
#include "tests/support/temp_dir.h"
#include "vdb/model_file.h"
#include "vdb/openvdb_grids.h"
#include "vdb/vdb_file.h"
#include "vdb/vdb_seal.h"

using namespace nerfvdb;
using Catch::Matchers::Contains;
using test::shellModel;
namespace fs = std::filesystem;

namespace {

std::string messageOf(const fs::path& path) {
    try {
        loadModel(path);
    } catch (const Error& error) {
        return error.what();
    }
    return "no error";
}

void writeBytes(const fs::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
}

openvdb::FloatGrid::Ptr foreignGrid() {
    openvdb::initialize();
    auto grid = openvdb::FloatGrid::create(0.0f);
    grid->setName("density");
    grid->fill(openvdb::CoordBBox({0, 0, 0}, {20, 20, 20}), 1.0f);
    return grid;
}

}  // namespace

TEST_CASE("metadata that claims more than the file holds is refused") {
    const TempDir folder;
    saveModel(shellModel(8, 4), folder / "good.vdb");
    const std::string good = readFile(folder / "good.vdb");
    const std::size_t count_at = kVdbUuidBegin + kVdbUuidSize;
    for (std::size_t at = count_at; at < count_at + 8; ++at) {  // a count and the length of a name
        std::string bytes = good;
        bytes.replace(at, 4, 4, '\xff');
        sealVdb(bytes);
        writeBytes(folder / "bad.vdb", bytes);
        CHECK_THAT(messageOf(folder / "bad.vdb"), Contains("bad.vdb"));
    }
    std::string old = good;
    old[8] = 10;  // a .vdb format whose header is another
    sealVdb(old);
    writeBytes(folder / "bad.vdb", old);
    CHECK_THAT(messageOf(folder / "bad.vdb"), Contains("format 10"));
}

TEST_CASE("a box that a few bytes claim and no memory holds is refused") {
    const TempDir folder;
    saveModel(shellModel(8, 4), folder / "model.vdb");
    openvdb::initialize();
    openvdb::io::File in((folder / "model.vdb").string());
    in.open(false);
    openvdb::MetaMap facts(*in.getMetadata());
    facts.insertMeta("nerfvdb_dims", openvdb::Vec3IMetadata(openvdb::Vec3i(1 << 20)));
    writeVdb(folder / "bad.vdb", {foreignGrid()}, facts);
    CHECK_THAT(messageOf(folder / "bad.vdb"), Contains("nerfvdb_cells") && Contains("1048576"));
}

TEST_CASE("damaged models are refused before anything is parsed") {
    const TempDir folder;
    saveModel(shellModel(24), folder / "good.vdb");
    const std::string good = readFile(folder / "good.vdb");
    const fs::path bad = folder / "bad.vdb";
    int tried = 0, refused = 0;
    const auto isRefused = [&](const std::string& bytes) {
        writeBytes(bad, bytes);
        const std::string message = messageOf(bad);
        const bool with_reason =
            message.starts_with(bad.string() + ": found ") && message.find(", expected ") != message.npos;
        ++tried, refused += with_reason;
        return with_reason;
    };
    for (std::uint64_t i = 0; i < 200; ++i) {  // single bits, anywhere
        const std::uint64_t random = randomBits(7, 0, i);
        std::string flipped = good;
        flipped[(random >> 3) % good.size()] ^= static_cast<char>(1 << (random & 7));
        CHECK(isRefused(flipped));
    }
    for (std::size_t i = 0; i < 64; ++i) CHECK(isRefused(good.substr(0, good.size() * i / 64)));
    std::cout << "survived: " << refused << " of " << tried << " damaged models refused with the reason" << std::endl;
    for (std::size_t at = 0; at < 100; ++at) {  // every byte of the header
        std::string flipped = good;
        flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
        writeBytes(bad, flipped);
        CHECK_THROWS_AS(loadModel(bad), DataError);
    }
    writeBytes(bad, good + "x");
    CHECK_THAT(messageOf(bad), Contains("bad.vdb") && Contains("checksum"));
    writeBytes(bad, good.substr(0, good.size() - 1));
    CHECK_THAT(messageOf(bad), Contains("truncated"));
}

TEST_CASE("what is not a model is told apart") {
    const TempDir folder;
    CHECK_THROWS_AS(loadModel(folder / "absent.vdb"), IoError);
    CHECK_THROWS_AS(isVdbFile(folder / "absent.vdb"), IoError);
    CHECK_THROWS_AS(loadModel(folder.path()), IoError);

    writeBytes(folder / "text.vdb", "once upon a time there was a text file that was no volume at all");
    CHECK_THAT(messageOf(folder / "text.vdb"), Contains("no .vdb file"));
    CHECK_FALSE(isVdbFile(folder / "text.vdb"));
    writeBytes(folder / "empty.vdb", "");
    CHECK_THAT(messageOf(folder / "empty.vdb"), Contains("an empty file"));
    CHECK_FALSE(isVdbFile(folder / "empty.vdb"));

    openvdb::io::File((folder / "foreign.vdb").string()).write(openvdb::GridCPtrVec{foreignGrid()});
    CHECK_THAT(messageOf(folder / "foreign.vdb"), Contains("not a nerfvdb model"));
    CHECK(isVdbFile(folder / "foreign.vdb"));

    writeVdb(folder / "volume.vdb", {foreignGrid()}, {});
    CHECK_THAT(messageOf(folder / "volume.vdb"), Contains("exported volume"));

    // A model that went through another program: its grids and metadata live on, its seal does not.
    saveModel(shellModel(24), folder / "model.vdb");
    openvdb::io::File in((folder / "model.vdb").string());
    in.open(false);
    openvdb::io::File((folder / "again.vdb").string()).write(*in.getGrids(), *in.getMetadata());
    CHECK_THAT(messageOf(folder / "again.vdb"), Contains("written anew"));

    // A model of another version: intact, but not for this program. And one whose network cannot be.
    const auto messageWith = [&](const char* name, int value) {
        openvdb::MetaMap facts(*in.getMetadata());
        facts.insertMeta(name, openvdb::Int32Metadata(value));
        writeVdb(folder / "other.vdb", {foreignGrid()}, facts);
        return messageOf(folder / "other.vdb");
    };
    CHECK_THAT(messageWith("nerfvdb_format", 5), Contains("nerfvdb_format") && Contains("newer"));
    CHECK_THAT(messageWith("nerfvdb_format", 1), Contains("nerfvdb_format") && Contains("older"));
    for (const int width : {-1, 0, 1025}) CHECK_THAT(messageWith("nerfvdb_decoder_width", width), Contains("1 to 1024"));
    CHECK_THAT(messageWith("nerfvdb_channels", 5), Contains("nerfvdb_channels") && Contains("4, 8 or 16"));
}

TEST_CASE("sealed models with parts that do not fit are refused") {
    const TempDir folder;
    saveModel(shellModel(24), folder / "model.vdb");
    openvdb::io::File in((folder / "model.vdb").string());
    in.open(false);
    const openvdb::MetaMap::Ptr good = in.getMetadata();
    const auto refusal = [&](const std::string& name, const openvdb::Metadata* value) {
        openvdb::MetaMap map(*good);
        map.removeMeta(name);
        if (value) map.insertMeta(name, *value);
        writeVdb(folder / "bad.vdb", {foreignGrid()}, map);
        return messageOf(folder / "bad.vdb");
    };
    for (const char* name : {"nerfvdb_dims", "nerfvdb_values", "nerfvdb_decoder", "nerfvdb_voxel_size", "nerfvdb_seed"})
        CHECK_THAT(refusal(name, nullptr), Contains(name) && Contains("nothing"));
    const openvdb::Int32Metadata channels(9), no_channels(-1);
    CHECK_THAT(refusal("nerfvdb_channels", &channels), Contains("bad.vdb"));
    CHECK_THAT(refusal("nerfvdb_channels", &no_channels), Contains("nerfvdb_channels"));
    const openvdb::DoubleMetadata nan(NAN);
    CHECK_THAT(refusal("nerfvdb_voxel_size", &nan), Contains("a positive number"));
    const openvdb::Vec3IMetadata small(openvdb::Vec3i(16)), crooked(openvdb::Vec3i(25));
    CHECK_THAT(refusal("nerfvdb_dims", &small), Contains("nerfvdb_cells"));
    CHECK_THAT(refusal("nerfvdb_dims", &crooked), Contains("nerfvdb_cells"));

    openvdb::UnknownMetadata regions("nerfvdb_bytes");
    for (const auto& bytes : {openvdb::UnknownMetadata::ByteVec{}, openvdb::UnknownMetadata::ByteVec(12, 0),
                              openvdb::UnknownMetadata::ByteVec(12 + 8, 1)}) {
        regions.setValue(bytes);
        openvdb::MetaMap map(*good);
        map.insertMeta("nerfvdb_regions", regions);
        map.removeMeta("nerfvdb_format");
        map.insertMeta("nerfvdb_format", openvdb::Int32Metadata(4));
        map.insertMeta("nerfvdb_shells", openvdb::Int32Metadata(2));
        map.insertMeta("nerfvdb_shell_extent", openvdb::Vec3IMetadata(openvdb::Vec3i(8)));
        map.insertMeta("nerfvdb_shell_stride", openvdb::Int32Metadata(16));
        writeVdb(folder / "bad.vdb", {foreignGrid()}, map);
        CHECK_THAT(messageOf(folder / "bad.vdb"), Contains("nerfvdb_regions") && Contains("halved"));
    }

    // Finite, but of a size with which sums overflow.
    const auto& decoder_blob = dynamic_cast<const openvdb::UnknownMetadata&>(*(*good)["nerfvdb_decoder"]);
    auto weights = decoder_blob.value();
    const float large = 2e6f;
    std::memcpy(&weights[weights.size() - sizeof large], &large, sizeof large);
    openvdb::UnknownMetadata large_weight(decoder_blob.typeName());
    large_weight.setValue(weights);
    CHECK_THAT(refusal("nerfvdb_decoder", &large_weight), Contains("nerfvdb_decoder") && Contains("a million"));
    const auto& values_blob = dynamic_cast<const openvdb::UnknownMetadata&>(*(*good)["nerfvdb_values"]);
    auto values = values_blob.value();
    values[1] = 60;  // the first feature's step: 2^60
    openvdb::UnknownMetadata large_values(values_blob.typeName());
    large_values.setValue(values);
    CHECK_THAT(refusal("nerfvdb_values", &large_values), Contains("nerfvdb_values") && Contains("a million"));

    const openvdb::StringMetadata words("cameras");
    CHECK_THAT(refusal("nerfvdb_cameras", &words), Contains("nerfvdb_cameras"));

    // Learned values of the right length but the wrong content: refused or decoded, never a crash.
    for (const char* name : {"nerfvdb_cells", "nerfvdb_values", "nerfvdb_decoder"}) {
        const auto& blob = dynamic_cast<const openvdb::UnknownMetadata&>(*(*good)[name]);
        for (int i = 0; i < 24; ++i) {
            auto bytes = blob.value();
            bytes[bytes.size() * i / 24] ^= 0x41;
            openvdb::UnknownMetadata wrong(blob.typeName());
            wrong.setValue(bytes);
            refusal(name, &wrong);
            bytes.resize(bytes.size() * i / 24);
            wrong.setValue(bytes);
            CHECK(refusal(name, &wrong) != "no error");
        }
    }
}

TEST_CASE("a model whose cells do not lie where its regions say is refused") {
    const TempDir folder;
    const Vec3i dims(2, 2, 3);
    std::vector<std::uint8_t> halvings(static_cast<std::size_t>(2 * dims.prod()), 0);
    halvings[3] = 1, halvings[7] = halvings[9] = 2;
    const VoxelField field = test::halvedField(test::nestedField(Vec3i(32, 16, 24), 2, 4), dims, halvings);
    const auto messageWith = [&](const std::vector<std::uint8_t>& claimed) {
        Shells shells = field.shells();
        shells.regions = makeRegions(2, dims, claimed);
        Model model;
        model.field = VoxelField(field.topology(), field.frame(), shells, 4, field.densityScale());
        model.decoder = Decoder(4, 2);
        saveModel(model, folder / "a.vdb");
        return messageOf(folder / "a.vdb");
    };
    CHECK(messageWith(halvings) == "no error");
    for (const std::size_t region : {0, 3, 7, 20}) {
        std::vector<std::uint8_t> claimed = halvings;
        claimed[region] = claimed[region] == 0 ? 1 : claimed[region] - 1;
        CHECK_THAT(messageWith(claimed), Contains("nerfvdb_cells") && Contains("where a region says"));
    }
}
