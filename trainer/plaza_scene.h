// SPDX-License-Identifier: Apache-2.0
// A monument in the middle of a square of houses: cameras on a ring look inward, at something near with a town behind.
#pragma once

#include <memory>

#include "trainer/open_scene.h"

namespace nerfvdb {

/// The middle is the origin; houses begin 20 m from it, cameras walk at 7 m.
std::unique_ptr<OpenScene> makePlazaScene();

}  // namespace nerfvdb
