// SPDX-License-Identifier: Apache-2.0
// How the library speaks: it never prints and never exits; it tells a Report, and asks it whether to go on.
#pragma once

#include <cstdint>
#include <string>

namespace nerfvdb {

/// Listener for long work. The base class is silent and never cancels.
/// Threads: called from the thread that called the library; `cancelled` from any thread.
class Report {
public:
    virtual ~Report() = default;

    /// A stage of `total` units begins (0: unknown length); the previous stage is over.
    virtual void begin(const std::string& stage, std::int64_t total) { (void)stage, (void)total; }
    /// The current stage turns out to be of `total` units.
    virtual void replan(std::int64_t total) { (void)total; }
    /// `done` units are finished; `note` is a short state such as "loss 0.0012, 31.2 dB".
    virtual void update(std::int64_t done, const std::string& note) { (void)done, (void)note; }
    /// The current stage is finished.
    virtual void end() {}
    /// A fact worth a line.
    virtual void info(const std::string& line) { (void)line; }
    /// Suspicious but workable input, with advice.
    virtual void warn(const std::string& line) { (void)line; }
    /// True once the user asked to stop; long work then saves what it can and returns early.
    virtual bool cancelled() const { return false; }
};

}  // namespace nerfvdb
