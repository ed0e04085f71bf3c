// SPDX-License-Identifier: Apache-2.0
#include "vdb/vdb_file.h"

#include <openvdb/io/Stream.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <new>
#include <stdexcept>

#include "core/atomic_file.h"
#include "core/error.h"
#include "vdb/vdb_seal.h"

namespace nerfvdb {
namespace {

/// Garbage, made fit to be printed: OpenVDB quotes the file.
std::string asciiOf(std::string text) {
    for (char& c : text)
        if (const auto byte = static_cast<unsigned char>(c); byte < 0x20 || byte >= 0x7f) c = '?';
    return text;
}

/// What is left of a damaged file may claim any size: OpenVDB believes it.
DataError tooLarge(const std::filesystem::path& path) {
    return {path.string(), "content that asks for more memory than there is", "a .vdb volume that fits",
            "copy or export the file again if it is damaged, else resample it coarser"};
}

/// Archive's own writing into a stream of ours: io::File would not tell that the disk is full.
class StreamArchive : public openvdb::io::Archive {
public:
    void writeSeekable(std::ostream& out, const openvdb::GridCPtrVec& grids, const openvdb::MetaMap& metadata) const {
        constexpr bool kSeekable = true;
        Archive::write(out, grids, kSeekable, metadata);
    }
};

}  // namespace

openvdb::math::Transform::Ptr gridTransform(const GridFrame& frame) {
    if (frame.voxel_size < kSmallestVoxel)
        throw DataError("grid", "a voxel of " + std::to_string(frame.voxel_size) + " world units",
                        "at least 2e-5, as OpenVDB can say", "scale the camera poses up");
    auto transform = openvdb::math::Transform::createLinearTransform(frame.voxel_size);
    transform->postTranslate(openvdb::Vec3d(frame.origin.data()));
    return transform;
}

float volumeSigma(float raw, double density_scale, double voxel_size) {
    constexpr double kOpaqueDepth = 16;
    return std::min(sigmaFromRaw(raw, density_scale), static_cast<float>(kOpaqueDepth / voxel_size));
}

bool halfSuffices(float largest_sigma, double voxel_size) {
    constexpr double kSmallestNormalHalf = 6.1e-5, kInvisibleAlpha = 1e-3;
    return largest_sigma <= kLargestHalf && kSmallestNormalHalf * voxel_size <= kInvisibleAlpha;
}

void writeVdb(const std::filesystem::path& path, const openvdb::GridCPtrVec& grids,
              const openvdb::MetaMap& metadata) {
    writeAtomically(path, [&](const std::filesystem::path& temporary) {
        errno = 0;
        try {
            {
                std::ofstream out;
                out.exceptions(std::ios::failbit | std::ios::badbit);
                out.open(temporary, std::ios::binary);
                StreamArchive archive;
                archive.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
                archive.writeSeekable(out, grids, metadata);
                out.close();
            }
            std::string bytes = readFile(temporary);
            sealVdb(bytes);
            std::fstream out;
            out.exceptions(std::ios::failbit | std::ios::badbit);
            out.open(temporary, std::ios::binary | std::ios::in | std::ios::out);
            out.seekp(kVdbUuidBegin);
            out.write(&bytes[kVdbUuidBegin], kVdbUuidSize);
            out.close();
        } catch (const std::ios_base::failure&) {
            const int reason = errno;
            throw IoError(path.string(), reason ? std::strerror(reason) : "a failed write",
                          "room for the whole file", "free some space or choose another folder");
        } catch (const openvdb::Exception& error) {
            throw IoError(path.string(), std::string("OpenVDB's error \"") + error.what() + "\"",
                          "grids that can be written");
        }
    });
}

VdbContent readVdb(const std::filesystem::path& path) {
    std::string bytes = readFile(path);
    const VdbSeal seal = checkVdbSeal(bytes);
    if (seal == VdbSeal::not_vdb)
        throw DataError(path.string(), bytes.empty() ? "an empty file" : "no .vdb file", "a .vdb volume");
    if (seal == VdbSeal::broken)
        throw DataError(path.string(), "damaged or truncated content (it does not match its checksum)",
                        "an intact volume", "copy or export the file again");
    std::string().swap(bytes);
    try {
        openvdb::initialize();
        // A stream of ours: behind its end io::File would go on, and take what it finds in memory for sizes.
        std::ifstream in;
        in.exceptions(std::ios::failbit | std::ios::badbit);
        in.open(path, std::ios::binary);
        constexpr bool kDelayedLoading = false;
        openvdb::io::Stream file(in, kDelayedLoading);
        return {file.getGrids(), file.getMetadata()};
    } catch (const openvdb::Exception& error) {
        throw DataError(path.string(), "OpenVDB's error \"" + asciiOf(error.what()) + "\"", "a .vdb volume");
    } catch (const std::ios_base::failure&) {
        throw DataError(path.string(), "a truncated file", "a whole .vdb volume", "copy or export the file again");
    } catch (const std::bad_alloc&) {
        throw tooLarge(path);
    } catch (const std::length_error&) {
        throw tooLarge(path);
    }
}

}  // namespace nerfvdb
