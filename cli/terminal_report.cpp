// SPDX-License-Identifier: Apache-2.0
#include "cli/terminal_report.h"

#include <signal.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cmath>
#include <iostream>

#include "cli/text.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

volatile sig_atomic_t interrupted = 0;

constexpr double kRedrawSeconds = 0.1;  // on a terminal
constexpr double kLineSeconds = 10;     // in a file
constexpr double kRateSeconds = 0.5;    // between measurements of the rate
constexpr double kRateMemory = 5;       // seconds after which an old rate weighs 1/e

double secondsBetween(std::chrono::steady_clock::time_point a, std::chrono::steady_clock::time_point b) {
    return std::chrono::duration<double>(b - a).count();
}

std::size_t terminalWidth() {
    winsize size{};
    if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 20) return size.ws_col;
    return 80;
}

}  // namespace

void catchInterrupts() {
    struct sigaction action {};
    action.sa_handler = [](int) { interrupted = 1; };
    action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
}

TerminalReport::TerminalReport() : terminal_(isatty(STDERR_FILENO)) {}

TerminalReport::~TerminalReport() { eraseProgress(); }

bool TerminalReport::cancelled() const { return interrupted != 0; }

void TerminalReport::begin(const std::string& stage, std::int64_t total) {
    if (!stage_.empty()) end();
    stage_ = stage;
    note_.clear();
    total_ = total;
    done_ = 0;
    rate_done_ = -1;
    rate_ = 0;
    began_ = drawn_ = rated_ = Clock::now();
}

void TerminalReport::replan(std::int64_t total) { total_ = total; }

void TerminalReport::update(std::int64_t done, const std::string& note) {
    if (stage_.empty()) return;
    done_ = done;
    note_ = note;
    const auto now = Clock::now();

    // The rate of the last seconds, not of the whole stage: training steps change their cost as it goes.
    // What the first update tells may have been done before the stage began, as when training is resumed.
    const double interval = secondsBetween(rated_, now);
    if (rate_done_ < 0 || interval >= kRateSeconds) {
        if (rate_done_ >= 0) {
            const double rate = static_cast<double>(done - rate_done_) / interval;
            const double keep = rate_ == 0 ? 0 : std::exp(-interval / kRateMemory);
            rate_ = keep * rate_ + (1 - keep) * rate;
        }
        rate_done_ = done;
        rated_ = now;
    }

    if (secondsBetween(drawn_, now) < (terminal_ ? kRedrawSeconds : kLineSeconds)) return;
    drawn_ = now;
    const std::string line = progress(secondsBetween(began_, now));
    if (!terminal_) return print(line);
    std::cerr << '\r' << line.substr(0, terminalWidth() - 1) << "\x1b[K" << std::flush;
    progress_shown_ = true;
}

void TerminalReport::end() {
    if (stage_.empty()) return;
    const double elapsed_s = secondsBetween(began_, Clock::now());
    // A stage that nobody had time to read about says nothing.
    if (elapsed_s >= 1)
        print(stage_ + ": " + durationText(elapsed_s) + (note_.empty() ? "" : ", " + note_));
    else
        eraseProgress();
    stage_.clear();
}

void TerminalReport::info(const std::string& line) { print(printable(line)); }

void TerminalReport::warn(const std::string& line) { print("warning: " + printable(line)); }

/// "train: 43 %, 1234 of 2870, 210 / s, 8 s left, 31.2 dB"
std::string TerminalReport::progress(double elapsed_s) const {
    std::string line = stage_ + ": ";
    if (total_ > 0) {
        line += formatted("%.0f %%, ", 100.0 * static_cast<double>(done_) / static_cast<double>(total_));
        line += std::to_string(done_) + " of " + std::to_string(total_);
    } else {
        line += std::to_string(done_) + " in " + durationText(elapsed_s);
    }
    if (rate_ > 0) {
        line += formatted(rate_ < 10 ? ", %.2f / s" : ", %.0f / s", rate_);
        if (total_ > done_) line += ", " + durationText(static_cast<double>(total_ - done_) / rate_) + " left";
    }
    if (!note_.empty()) line += ", " + note_;
    return line;
}

void TerminalReport::print(const std::string& line) {
    eraseProgress();
    std::cerr << line << '\n';
}

void TerminalReport::eraseProgress() {
    if (!progress_shown_) return;
    std::cerr << "\r\x1b[K" << std::flush;
    progress_shown_ = false;
}

}  // namespace nerfvdb
