// SPDX-License-Identifier: Apache-2.0
#include "vdb/shells.h"

namespace nerfvdb {

Regions::Regions(const Vec3i& dims_, std::vector<std::uint8_t> halvings_) : dims(dims_), halvings(std::move(halvings_)) {
    const std::size_t in_shell = indexOf(1, Vec3i::Zero());
    halved.resize(in_shell > 0 ? halvings.size() / in_shell : 0);
    for (std::size_t i = 0; i < halved.size() * in_shell; ++i) {
        most = std::max(most, static_cast<int>(halvings[i]));
        if (halvings[i] == 0) continue;
        const auto n = static_cast<int>(i % in_shell);
        const Vec3i region(n / (dims.y() * dims.z()), n / dims.z() % dims.y(), n % dims.z());
        Range& range = halved[i / in_shell];
        const bool is_first = (range.end.array() == 0).all();
        range.first = is_first ? region : Vec3i(range.first.cwiseMin(region));
        range.end = range.end.cwiseMax(region + Vec3i::Ones());
    }
}

std::shared_ptr<const Regions> makeRegions(int shells, const Vec3i& dims, std::vector<std::uint8_t> halvings) {
    constexpr int kMost = 1 << 10;  // along an axis
    if (shells < 1 || shells > kMaxShells || (dims.array() < 1).any() || (dims.array() > kMost).any()) return nullptr;
    if (halvings.size() != static_cast<std::size_t>(shells) * dims.x() * dims.y() * dims.z()) return nullptr;
    if (*std::max_element(halvings.begin(), halvings.end()) > kMostHalvings) return nullptr;
    return std::make_shared<const Regions>(dims, std::move(halvings));
}

}  // namespace nerfvdb
