// SPDX-License-Identifier: Apache-2.0
// What tests of trainings that are stopped and resumed share.
#pragma once

#include <string>
#include <vector>

#include "core/atomic_file.h"
#include "core/report.h"
#include "tests/support/temp_dir.h"
#include "trainer/trainer.h"
#include "vdb/model_file.h"

namespace nerfvdb::test {

/// Asks to stop once it was asked `limit` times; training asks once a step.
class StopAfter : public Report {
public:
    explicit StopAfter(int limit) : limit_(limit) {}
    bool cancelled() const override { return count_++ >= limit_; }
    void warn(const std::string& line) override { warnings.push_back(line); }

    std::vector<std::string> warnings;

private:
    int limit_;
    mutable int count_ = 0;
};

/// Bytes of the model file that a result becomes.
inline std::string modelBytes(const TrainResult& result, const TempDir& dir) {
    saveModel(result.model, dir / "model.vdb");
    return readFile(dir / "model.vdb");
}

}  // namespace nerfvdb::test
