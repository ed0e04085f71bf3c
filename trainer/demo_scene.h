// SPDX-License-Identifier: Apache-2.0
// The composite scene that the README's demo trains on.
#pragma once

#include <memory>

#include "trainer/synthetic_scene.h"

namespace nerfvdb {

/// A pierced porcelain ball (a gyroid sheet) around a golden core, on a round plinth with an enamelled band.
/// Shadow and ambient occlusion are baked when the scene is made (about a second on two cores).
std::unique_ptr<SyntheticScene> makeDemoScene();

}  // namespace nerfvdb
