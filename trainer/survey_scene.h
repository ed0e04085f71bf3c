// SPDX-License-Identifier: Apache-2.0
// A street from the air: a survey's rows of photographs that look down.
#pragma once

#include <memory>

#include "trainer/open_scene.h"

namespace nerfvdb {

/// 100 m of the street; cameras fly at 40 m in five rows along it, from row to row and from view to view half a picture
/// and less apart, as straight down as the wind lets them.
std::unique_ptr<OpenScene> makeSurveyScene();

}  // namespace nerfvdb
