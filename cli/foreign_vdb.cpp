// SPDX-License-Identifier: Apache-2.0
#include "cli/foreign_vdb.h"

#include <signal.h>
#include <sys/resource.h>

#include <string>

#include "cli/commands.h"
#include "core/child_process.h"
#include "core/error.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCommand = "read-vdb";
constexpr const char* kPrefix = "nerfvdb: ";  // of what main() complains

void limit(__rlimit_resource resource, std::uintmax_t value) {
    const rlimit both{static_cast<rlim_t>(value), static_cast<rlim_t>(value)};
    setrlimit(resource, &both);
}

/// What the child does. A leaf of the widest values packs 200 to one; beyond that a file lies.
void readLimited(const fs::path& path) {
    signal(SIGINT, SIG_DFL);
    signal(SIGTERM, SIG_DFL);
    const std::uintmax_t bytes = fs::file_size(path);
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_CPU, 60 + bytes / 1'000'000);  // seconds
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // whose shadows take more than any limit
    limit(RLIMIT_DATA, (std::uintmax_t{1} << 30) + 256 * bytes);
#endif
    listGrids(path);
}

}  // namespace

void tryForeignVdb(const fs::path& path) {
    if (!isForeignVdbFile(path)) return;
    std::string last_line;
    const ChildEnd end = runChild({"/proc/self/exe", {kCommand, "--", path.string()}, {}},
                                  [&](std::string_view line) { last_line = line; }, [] { return false; });
    if (end.isGood()) return;
    if (end.signal == SIGINT || end.signal == SIGTERM)
        throw Interrupted("stopped while " + path.string() + " was read");
    if (end.signal == 0 && last_line.starts_with(kPrefix))
        throw DataError(last_line.substr(std::string_view(kPrefix).size()));
    throw DataError(path.string(),
                    "content that OpenVDB cannot read (" +
                        (end.signal ? "it died of signal " + std::to_string(end.signal)
                                    : "exit code " + std::to_string(end.exit_code)) +
                        ")",
                    "a .vdb volume", "is it damaged? copy or export the file again");
}

Command addReadVdb(CLI::App& program) {
    auto path = std::make_shared<std::string>();
    CLI::App& app = *program.add_subcommand(kCommand, "What tryForeignVdb runs")->group("");  // not in --help
    app.add_option("PATH", *path)->required();
    return {&app, [path] { readLimited(*path); }};
}

}  // namespace nerfvdb
