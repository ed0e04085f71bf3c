// SPDX-License-Identifier: Apache-2.0
// Report for a person at a terminal: one line of progress that is redrawn, or plain lines now and then when
// standard error is a file. Ctrl-C and SIGTERM become Report::cancelled; a second one kills as usual.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "core/report.h"

namespace nerfvdb {

class TerminalReport : public Report {
public:
    TerminalReport();
    ~TerminalReport() override;

    void begin(const std::string& stage, std::int64_t total) override;
    void replan(std::int64_t total) override;
    void update(std::int64_t done, const std::string& note) override;
    void end() override;
    void info(const std::string& line) override;
    void warn(const std::string& line) override;
    bool cancelled() const override;

private:
    using Clock = std::chrono::steady_clock;
    std::string progress(double elapsed_s) const;
    void print(const std::string& line);
    void eraseProgress();

    const bool terminal_;
    bool progress_shown_ = false;
    std::string stage_;
    std::string note_;
    std::int64_t total_ = 0, done_ = 0;
    double rate_ = 0;  // units per second, smoothed
    std::int64_t rate_done_ = -1;  // when the rate was last measured; -1: not yet
    Clock::time_point began_, drawn_, rated_;
};

/// SIGINT and SIGTERM set a flag instead of ending the process; the second one ends it.
void catchInterrupts();

}  // namespace nerfvdb
