// SPDX-License-Identifier: Apache-2.0
// The log beside a model: how training went, a row of CSV per interval.
#pragma once

#include <filesystem>
#include <string>

#include "core/report.h"
#include "trainer/trainer.h"

namespace nerfvdb {

/// Rewritten whole at each interval, so that it is never cut off. Until the run has replaced the checkpoint
/// (or, without one, the model) of the run before it, its log lies in PATH.part, and the earlier log stays. A
/// log that cannot be written is a warning, once.
class CsvLog {
public:
    /// A resumed run continues the rows and the seconds of the log at `path`, if there is one. Throws IoError.
    CsvLog(std::filesystem::path path, bool resume, Report& report);
    /// Removes PATH.part.
    ~CsvLog();
    CsvLog(const CsvLog&) = delete;
    CsvLog& operator=(const CsvLog&) = delete;

    void add(const TrainProgress& progress);

    /// The model is in its file: so is the log now.
    void finish();

private:
    void keepEarlierRows(std::int64_t before_step);
    void write(const std::filesystem::path& path);

    const std::filesystem::path path_, part_;
    Report& report_;
    std::string earlier_, rows_;
    double earlier_seconds_ = 0;
    bool has_warned_ = false;
};

}  // namespace nerfvdb
