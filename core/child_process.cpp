// SPDX-License-Identifier: Apache-2.0
#include "core/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>

#include "core/error.h"

extern char** environ;

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kPollMs = 100;
constexpr auto kGrace = std::chrono::seconds(5);  // between SIGTERM and SIGKILL
constexpr std::size_t kLongestLine = 1 << 16;     // what is longer comes in pieces

IoError cannotStart(const fs::path& program, int reason) {
    return IoError(program.string(), std::strerror(reason), "a program that can be started",
                   "check its installation");
}

/// Both ends of a pipe; closed on exec, or the child would hold its own pipe open.
class Pipe {
public:
    Pipe() : reason_(pipe2(ends_, O_CLOEXEC) == 0 ? 0 : errno) {}
    ~Pipe() {
        closeWriter();
        if (reason_ == 0) close(ends_[0]);
    }
    Pipe(const Pipe&) = delete;
    Pipe& operator=(const Pipe&) = delete;

    int reason() const { return reason_; }  // 0, or why there is no pipe
    int reader() const { return ends_[0]; }
    int writer() const { return ends_[1]; }
    void closeWriter() {
        if (reason_ == 0 && ends_[1] >= 0) close(ends_[1]);
        ends_[1] = -1;
    }

private:
    int ends_[2] = {-1, -1};
    int reason_;
};

/// This process's environment with some names set anew.
std::vector<std::string> mergedEnvironment(const std::vector<std::string>& changes) {
    const auto nameOf = [](const std::string& entry) { return entry.substr(0, entry.find('=')); };
    std::vector<std::string> merged = changes;
    for (char** entry = environ; *entry; ++entry)
        if (std::none_of(changes.begin(), changes.end(),
                         [&](const std::string& change) { return nameOf(change) == nameOf(*entry); }))
            merged.emplace_back(*entry);
    return merged;
}

std::vector<char*> pointersTo(std::vector<std::string>& texts) {
    std::vector<char*> pointers;
    for (std::string& text : texts) pointers.push_back(text.data());
    pointers.push_back(nullptr);
    return pointers;
}

/// A running child; waits for its end at the latest when it is destroyed.
class Child {
public:
    Child(const ChildCommand& command, const Pipe& pipe) {
        std::vector<std::string> words{command.program.string()};
        words.insert(words.end(), command.arguments.begin(), command.arguments.end());
        std::vector<std::string> environment = mergedEnvironment(command.environment);

        posix_spawn_file_actions_t actions;
        posix_spawn_file_actions_init(&actions);
        posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
        posix_spawn_file_actions_adddup2(&actions, pipe.writer(), STDOUT_FILENO);
        posix_spawn_file_actions_adddup2(&actions, pipe.writer(), STDERR_FILENO);

        // Signals that this process ignores would stay ignored in the child.
        posix_spawnattr_t attributes;
        posix_spawnattr_init(&attributes);
        sigset_t none, usual;
        sigemptyset(&none);
        sigemptyset(&usual);
        for (const int signal : {SIGINT, SIGTERM, SIGPIPE, SIGXFSZ}) sigaddset(&usual, signal);
        posix_spawnattr_setsigmask(&attributes, &none);
        posix_spawnattr_setsigdefault(&attributes, &usual);
        posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);

        const int reason = posix_spawn(&id_, command.program.c_str(), &actions, &attributes,
                                       pointersTo(words).data(), pointersTo(environment).data());
        posix_spawnattr_destroy(&attributes);
        posix_spawn_file_actions_destroy(&actions);
        if (reason != 0) throw cannotStart(command.program, reason);
    }
    ~Child() {
        if (has_ended_) return;
        kill(id_, SIGKILL);
        wait(0);
    }
    Child(const Child&) = delete;
    Child& operator=(const Child&) = delete;

    void signal(int number) const {
        if (!has_ended_) kill(id_, number);
    }
    /// True once it has ended; `options` as waitpid's.
    bool wait(int options) {
        while (!has_ended_) {
            const pid_t got = waitpid(id_, &status_, options);
            if (got == 0) return false;
            has_ended_ = got == id_ || errno != EINTR;
        }
        return true;
    }
    ChildEnd end() const {
        ChildEnd end;
        if (WIFSIGNALED(status_)) end.signal = WTERMSIG(status_);
        if (WIFEXITED(status_)) end.exit_code = WEXITSTATUS(status_);
        return end;
    }

private:
    pid_t id_ = -1;
    int status_ = 0;
    bool has_ended_ = false;
};

/// Cuts bytes into lines. A progress line that is drawn over itself ends in \r; empty lines are told too, but not
/// between \r and \n.
class LineCutter {
public:
    explicit LineCutter(const std::function<void(std::string_view)>& line) : line_(line) {}

    void add(std::string_view bytes) {
        for (const char c : bytes) {
            if (c == '\n' && after_return_) {
                after_return_ = false;
                continue;
            }
            after_return_ = c == '\r';
            if (c == '\n' || c == '\r' || text_.size() == kLongestLine) tell();
            if (c != '\n' && c != '\r') text_ += c;
        }
    }
    void finish() {
        if (!text_.empty()) tell();
    }

private:
    void tell() {
        line_(text_);
        text_.clear();
    }
    const std::function<void(std::string_view)>& line_;
    std::string text_;
    bool after_return_ = false;
};

/// What is in the pipe now or within the wait; false at its end.
bool readPipe(int reader, int wait_ms, LineCutter& lines, bool& got_bytes) {
    got_bytes = false;
    pollfd poll_for{reader, POLLIN, 0};
    if (poll(&poll_for, 1, wait_ms) <= 0) return true;
    std::array<char, 16384> bytes;
    const ssize_t count = read(reader, bytes.data(), bytes.size());
    if (count < 0) return errno == EINTR;
    if (count == 0) return false;
    got_bytes = true;
    lines.add({bytes.data(), static_cast<std::size_t>(count)});
    return true;
}

}  // namespace

std::optional<fs::path> findProgram(const std::string& name) {
    const char* path = std::getenv("PATH");
    if (!path) return std::nullopt;
    std::string_view rest = path;
    while (true) {
        const std::size_t colon = rest.find(':');
        const std::string_view folder = rest.substr(0, colon);
        const fs::path candidate = (folder.empty() ? fs::path(".") : fs::path(folder)) / name;
        std::error_code ignored;
        if (fs::is_regular_file(candidate, ignored) && access(candidate.c_str(), X_OK) == 0) return candidate;
        if (colon == std::string_view::npos) return std::nullopt;
        rest.remove_prefix(colon + 1);
    }
}

ChildEnd runChild(const ChildCommand& command, const std::function<void(std::string_view)>& line,
                  const std::function<bool()>& should_stop) {
    Pipe pipe;
    if (pipe.reason() != 0) throw cannotStart(command.program, pipe.reason());
    Child child(command, pipe);
    pipe.closeWriter();

    LineCutter lines(line);
    std::optional<Clock::time_point> stopped_at;
    const auto stopIfAsked = [&] {
        if (!stopped_at && should_stop()) {
            stopped_at = Clock::now();
            child.signal(SIGTERM);
        }
        if (stopped_at && Clock::now() - *stopped_at > kGrace) child.signal(SIGKILL);
    };
    bool is_open = true, got_bytes = false;
    while (is_open) {
        is_open = readPipe(pipe.reader(), kPollMs, lines, got_bytes);
        stopIfAsked();
        // A process that the child left behind may hold the pipe open for ever.
        if (!got_bytes && child.wait(WNOHANG)) break;
    }
    lines.finish();

    // Whoever closed its output may live on.
    while (!child.wait(WNOHANG)) {
        stopIfAsked();
        poll(nullptr, 0, kPollMs / 10);
    }
    ChildEnd end = child.end();
    end.is_stopped = stopped_at.has_value();
    return end;
}

}  // namespace nerfvdb
