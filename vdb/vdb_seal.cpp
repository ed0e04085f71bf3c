// SPDX-License-Identifier: Apache-2.0
#include "vdb/vdb_seal.h"

#include <span>

#include "core/atomic_file.h"

namespace nerfvdb {
namespace {

constexpr std::string_view kMagic{" BDV\0\0\0\0", 8};
constexpr std::size_t kVersionDigit = 14;  // of the UUID

/// 32 hexadecimal digits as a UUID; six bits give way to version 8 and the variant of RFC 9562, section 5.8.
std::string uuidFromHash(std::string hash) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    hash[12] = '8';
    hash[16] = kDigits[8 | (kDigits.find(hash[16]) & 3)];
    for (const std::size_t dash : {8, 13, 18, 23}) hash.insert(dash, 1, '-');
    return hash;
}

bool hasUuid(std::string_view bytes) { return bytes.size() >= kVdbUuidBegin + kVdbUuidSize; }

}  // namespace

bool hasVdbMagic(std::string_view bytes) { return bytes.starts_with(kMagic); }

bool isForeignVdb(std::string_view bytes) {
    return hasVdbMagic(bytes) && hasUuid(bytes) && bytes[kVdbUuidBegin + kVersionDigit] != '8';
}

void sealVdb(std::string& bytes) {
    if (!hasUuid(bytes)) return;
    bytes.replace(kVdbUuidBegin, kVdbUuidSize, kVdbUuidSize, '\0');  // counts as zeros
    const std::string seal = uuidFromHash(contentHash(std::as_bytes(std::span(bytes.data(), bytes.size()))));
    bytes.replace(kVdbUuidBegin, kVdbUuidSize, seal);
}

VdbSeal checkVdbSeal(std::string& bytes) {
    if (!hasVdbMagic(bytes)) return VdbSeal::not_vdb;
    if (!hasUuid(bytes)) return VdbSeal::broken;
    if (isForeignVdb(bytes)) return VdbSeal::foreign;
    const std::string stored = bytes.substr(kVdbUuidBegin, kVdbUuidSize);
    sealVdb(bytes);
    const bool is_intact = bytes.compare(kVdbUuidBegin, kVdbUuidSize, stored) == 0;
    bytes.replace(kVdbUuidBegin, kVdbUuidSize, stored);
    return is_intact ? VdbSeal::intact : VdbSeal::broken;
}

}  // namespace nerfvdb
