// SPDX-License-Identifier: Apache-2.0
#include "cli/csv_log.h"

#include <cstdlib>
#include <sstream>

#include "cli/text.h"
#include "core/atomic_file.h"
#include "core/error.h"

namespace nerfvdb {

CsvLog::CsvLog(std::filesystem::path path, bool resume, Report& report)
    : path_(std::move(path)), part_(path_.string() + ".part"), report_(report) {
    removeOrphans(part_);
    if (resume && std::filesystem::exists(path_)) earlier_ = readFile(path_);
}

CsvLog::~CsvLog() {
    std::error_code ignored;
    std::filesystem::remove(part_, ignored);
}

void CsvLog::add(const TrainProgress& progress) {
    if (rows_.empty()) keepEarlierRows(progress.step);
    rows_ += formatted("%lld,%.2f,%.6g,%.3f,%llu,%zu,%.6g,%.6g,%.6g\n", static_cast<long long>(progress.step),
                       earlier_seconds_ + progress.seconds, progress.loss, progress.psnr,
                       static_cast<unsigned long long>(progress.rays), progress.voxels, progress.distortion,
                       progress.entropy, progress.alpha_error);
    write(progress.has_checkpoint ? path_ : part_);
}

void CsvLog::finish() {
    if (!rows_.empty()) write(path_);
}

void CsvLog::keepEarlierRows(std::int64_t before_step) {
    rows_ = "step,seconds,loss,psnr,rays,voxels,distortion,entropy,alpha_error\n";
    std::istringstream earlier(earlier_);
    std::string row;
    std::getline(earlier, row);  // the head
    while (std::getline(earlier, row) && std::atoll(row.c_str()) < before_step) {
        rows_ += row + "\n";
        earlier_seconds_ = std::atof(row.c_str() + row.find(',') + 1);
    }
}

void CsvLog::write(const std::filesystem::path& path) {
    try {
        writeAtomically(path, rows_, Durable::system);
        std::error_code ignored;
        if (path == path_) std::filesystem::remove(part_, ignored);
    } catch (const IoError& error) {
        if (!has_warned_) report_.warn(std::string("log not written, training goes on: ") + error.what());
        has_warned_ = true;
    }
}

}  // namespace nerfvdb
