// SPDX-License-Identifier: Apache-2.0
// A street with houses on both sides, raised pavements, lamp posts and planters, as long as one likes: what large
// real scenes are like, with exact truth at every size.
#pragma once

#include <memory>

#include "trainer/open_scene.h"

namespace nerfvdb {

inline constexpr double kDefaultStreet = 200;  // metres
inline constexpr double kShortestStreet = 12, kLongestStreet = 20000;

/// The street runs along x from 0 to `length`. Cameras walk along its middle at eye level, a view each 5 m ahead and to
/// both sides. Throws UsageError for a length out of range.
std::unique_ptr<OpenScene> makeStreetScene(double length);

/// Training views for a length: 120 at 200 m.
int streetViews(double length);

}  // namespace nerfvdb
