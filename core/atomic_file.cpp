// SPDX-License-Identifier: Apache-2.0
#include "core/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "core/error.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

std::string adviceFor(int error_number) {
    switch (error_number) {
        case ENOSPC:
        case EDQUOT:
            return "free some disk space or write elsewhere";
        case EACCES:
        case EPERM:
        case EROFS:
            return "check the permissions or write elsewhere";
        case ENOENT:
            return "check the name";
        default:
            return {};
    }
}

[[noreturn]] void throwErrno(const fs::path& path, int error_number, const std::string& expected) {
    throw IoError(path.string(), std::strerror(error_number), expected, adviceFor(error_number));
}

/// A POSIX file descriptor that closes itself.
class Descriptor {
public:
    Descriptor(const fs::path& path, int flags, mode_t mode = 0666)
        : fd_(::open(path.c_str(), flags | O_CLOEXEC, mode)) {}
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    int get() const { return fd_; }
    bool isOpen() const { return fd_ >= 0; }

private:
    int fd_;
};

/// Deletes the temporary on every way out.
struct Remover {
    fs::path path;
    ~Remover() {
        std::error_code ignored;
        fs::remove(path, ignored);
    }
};

/// The folder must exist and take new files; asked before any work is done for the content.
void checkTarget(const fs::path& path, const fs::path& folder) {
    std::error_code ignored;
    if (!path.has_filename()) throw IoError(path.string(), "no file name", "a path that ends in a file name");
    const fs::file_status status = fs::status(path, ignored);
    if (fs::is_directory(status))
        throw IoError(path.string(), "a folder", "the name of a file to write", "add a file name");
    if (fs::exists(status) && !fs::is_regular_file(status))
        throw IoError(path.string(), "a device or pipe", "a plain file or a new name");
    if (!fs::exists(folder, ignored))
        throw IoError(path.string(), "no folder " + folder.string(), "an existing folder to write into",
                      "create it first");
    if (!fs::is_directory(folder, ignored))
        throw IoError(path.string(), folder.string() + " is a file", "an existing folder to write into");
}

void syncToDisk(const fs::path& temporary, const fs::path& path) {
    const Descriptor file(temporary, O_RDONLY);
    if (!file.isOpen()) throwErrno(path, errno, "a complete temporary file to rename");
    if (::fsync(file.get()) != 0) throwErrno(path, errno, "the file's content to reach the disk");
}

void writeAll(int fd, std::string_view bytes, const fs::path& path) {
    while (!bytes.empty()) {
        const ssize_t written = ::write(fd, bytes.data(), bytes.size());
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) throwErrno(path, errno, "room for the file's content");
        bytes.remove_prefix(static_cast<std::size_t>(written));
    }
}

void replaceFile(const fs::path& path, const std::function<void(const fs::path& temporary)>& write,
                 Durable durable) {
    std::error_code ignored;
    // A symbolic link stays one: its target is what gets replaced.
    const fs::path target = fs::is_symlink(path, ignored) ? fs::weakly_canonical(path, ignored) : path;
    const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
    checkTarget(target, folder);

    // Unique among processes and threads, so that two writers of one path cannot mix their halves.
    static std::atomic<unsigned> counter{0};
    fs::path name(target.stem());
    name += std::string(".").append(std::to_string(::getpid())).append("-");
    name += std::to_string(counter++) + ".part";
    name += target.extension();
    const Remover temporary{folder / name};
    {
        const Descriptor probe(temporary.path, O_WRONLY | O_CREAT | O_EXCL);
        if (!probe.isOpen()) throwErrno(path, errno, "a folder that can be written");
    }

    try {
        write(temporary.path);
    } catch (const Error&) {
        throw;
    } catch (const std::system_error& error) {
        throw IoError(path.string(), error.what(), "the file to be written", adviceFor(error.code().value()));
    } catch (const std::exception& error) {
        throw IoError(path.string(), error.what(), "the file to be written");
    }

    if (durable == Durable::disk) syncToDisk(temporary.path, path);
    if (::rename(temporary.path.c_str(), target.c_str()) != 0)
        throwErrno(path, errno, "the finished file to take its name");
    if (durable == Durable::system) return;
    // Make the new name durable too; some file systems cannot do that to a folder, and the content is safe.
    if (const Descriptor directory(folder, O_RDONLY | O_DIRECTORY); directory.isOpen())
        ::fsync(directory.get());
}

}  // namespace

void writeAtomically(const fs::path& path, const std::function<void(const fs::path& temporary)>& write) {
    replaceFile(path, write, Durable::disk);
}

void writeAtomically(const fs::path& path, std::string_view bytes, Durable durable) {
    const auto write = [&](const fs::path& temporary) {
        const Descriptor file(temporary, O_WRONLY | O_TRUNC);
        if (!file.isOpen()) throwErrno(path, errno, "a folder that can be written");
        writeAll(file.get(), bytes, path);
    };
    replaceFile(path, write, durable);
}

std::string readFile(const fs::path& path) {
    const Descriptor file(path, O_RDONLY);
    if (!file.isOpen()) throwErrno(path, errno, "a file that can be read");
    struct stat status;
    if (::fstat(file.get(), &status) != 0) throwErrno(path, errno, "a file that can be read");
    if (S_ISDIR(status.st_mode)) throw IoError(path.string(), "a folder", "a file");

    // The size is a hint: pipes say 0, and a file may grow or shrink while it is read.
    std::string bytes(static_cast<std::size_t>(status.st_size) + 1, '\0');
    std::size_t size = 0;
    for (;;) {
        if (size == bytes.size()) bytes.resize(2 * bytes.size());
        const ssize_t got = ::read(file.get(), bytes.data() + size, bytes.size() - size);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) throwErrno(path, errno, "a file that can be read");
        if (got == 0) break;
        size += static_cast<std::size_t>(got);
    }
    bytes.resize(size);
    return bytes;
}

std::string contentHash(std::span<const std::byte> bytes) {
    const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
    char digits[33];
    std::snprintf(digits, sizeof digits, "%016llx%016llx", static_cast<unsigned long long>(hash.high64),
                  static_cast<unsigned long long>(hash.low64));
    return digits;
}

}  // namespace nerfvdb
