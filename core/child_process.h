// SPDX-License-Identifier: Apache-2.0
// Other programs, run without a shell: their words arrive line by line, and they end when they are told to.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace nerfvdb {

/// The file that a shell would run for `name`: the first executable one in the folders of PATH.
std::optional<std::filesystem::path> findProgram(const std::string& name);

struct ChildCommand {
    std::filesystem::path program;
    std::vector<std::string> arguments;    // without the program's name
    std::vector<std::string> environment;  // "NAME=value", over what this process has
};

/// How a child ended: by itself with an exit code, or by a signal.
struct ChildEnd {
    int exit_code = 0;
    int signal = 0;           // 0: none
    bool is_stopped = false;  // because `should_stop` said so; the other fields then mean little

    bool isGood() const { return exit_code == 0 && signal == 0 && !is_stopped; }
};

/// Runs a program to its end. Its standard input is empty; what it writes to standard output and error reaches `line`,
/// without the line's end (\n or \r), from the calling thread. `should_stop` is asked ten times a second; on true the
/// child gets SIGTERM and, five seconds later, SIGKILL. The child stays in this process's group: Ctrl-C reaches both.
/// An exception of `line` ends the child too and passes through. Throws IoError when the program cannot be started.
ChildEnd runChild(const ChildCommand& command, const std::function<void(std::string_view)>& line,
                  const std::function<bool()>& should_stop);

}  // namespace nerfvdb
