// SPDX-License-Identifier: Apache-2.0
// The smallest subject of which everything can be measured: a sphere, sampled exactly, with pictures of it.
#pragma once

#include "bench/scene.h"
#include "tests/support/sphere_dataset.h"
#include "trainer/sample_scene.h"

namespace nerfvdb::test {

inline Subject sphereSubject() {
    Subject subject;
    subject.name = "sphere";
    subject.model = sampleScene(*makeSyntheticScene("sphere"), 96);
    subject.train = sphereDataset(Split::train, 3, 64);
    subject.test = sphereDataset(Split::test, 2, 32);
    return subject;
}

}  // namespace nerfvdb::test
