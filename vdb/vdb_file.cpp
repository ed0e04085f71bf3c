// SPDX-License-Identifier: Apache-2.0
#include "vdb/vdb_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <span>
#include <string_view>

#include "core/atomic_file.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

// A .vdb begins: int64 magic, uint32 format, uint32 library major and minor, one byte "has grid offsets", then
// the UUID as 36 characters.
constexpr std::string_view kMagic{" BDV\0\0\0\0", 8};
constexpr std::size_t kUuidBegin = 21, kUuidSize = 36;
constexpr std::size_t kVersionDigit = 14;  // of the UUID

/// 32 hexadecimal digits as a UUID; six bits give way to version 8 and the variant of RFC 9562, section 5.8.
std::string uuidFromHash(std::string hash) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    hash[12] = '8';
    hash[16] = kDigits[8 | (kDigits.find(hash[16]) & 3)];
    for (const std::size_t dash : {8, 13, 18, 23}) hash.insert(dash, 1, '-');
    return hash;
}

/// The UUID that belongs to a file; the one inside counts as zeros.
std::string sealOf(std::string& bytes) {
    const std::string stored = bytes.substr(kUuidBegin, kUuidSize);
    bytes.replace(kUuidBegin, kUuidSize, kUuidSize, '\0');
    const std::string seal = uuidFromHash(contentHash(std::as_bytes(std::span(bytes.data(), bytes.size()))));
    bytes.replace(kUuidBegin, kUuidSize, stored);
    return seal;
}

/// Archive's own writing into a stream of ours: io::File would not tell that the disk is full.
class StreamArchive : public openvdb::io::Archive {
public:
    void write(std::ostream& out, const openvdb::GridCPtrVec& grids, const openvdb::MetaMap& metadata) const {
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

bool hasVdbMagic(const std::string& bytes) { return bytes.starts_with(kMagic); }

VdbSeal checkVdbSeal(std::string& bytes) {
    if (!hasVdbMagic(bytes)) return VdbSeal::not_vdb;
    if (bytes.size() < kUuidBegin + kUuidSize) return VdbSeal::broken;
    if (bytes[kUuidBegin + kVersionDigit] != '8') return VdbSeal::foreign;
    return bytes.compare(kUuidBegin, kUuidSize, sealOf(bytes)) == 0 ? VdbSeal::intact : VdbSeal::broken;
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
                archive.write(out, grids, metadata);
                out.close();
            }
            std::string bytes = readFile(temporary);
            const std::string seal = sealOf(bytes);
            std::fstream out;
            out.exceptions(std::ios::failbit | std::ios::badbit);
            out.open(temporary, std::ios::binary | std::ios::in | std::ios::out);
            out.seekp(kUuidBegin);
            out.write(seal.data(), static_cast<std::streamsize>(seal.size()));
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

}  // namespace nerfvdb
