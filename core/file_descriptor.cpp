// SPDX-License-Identifier: Apache-2.0
#include "core/file_descriptor.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/error.h"

namespace nerfvdb {

Descriptor::Descriptor(const std::filesystem::path& path, int flags, mode_t mode)
    : fd_(::open(path.c_str(), flags | O_CLOEXEC, mode)) {}

Descriptor::~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
}

PlainFile::PlainFile(const std::filesystem::path& path) : file_(path, O_RDONLY | O_NONBLOCK) {
    struct stat status;
    if (!file_.isOpen() || ::fstat(file_.get(), &status) != 0) throwErrno(path, errno, "a file that can be read");
    if (S_ISDIR(status.st_mode)) throw IoError(path.string(), "a folder", "a file");
    if (!S_ISREG(status.st_mode))
        throw IoError(path.string(), "a pipe or a device", "a plain file", "save what comes from it as a file first");
    size_ = static_cast<std::size_t>(status.st_size);
}

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

void throwErrno(const std::filesystem::path& path, int error_number, const std::string& expected) {
    throw IoError(path.string(), std::strerror(error_number), expected, adviceFor(error_number));
}

void writeAll(int fd, std::span<const std::byte> bytes, const std::filesystem::path& path) {
    while (!bytes.empty()) {
        const ssize_t written = ::write(fd, bytes.data(), bytes.size());
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) throwErrno(path, errno, "room for the file's content");
        bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
}

std::size_t readAll(int fd, std::span<std::byte> bytes, const std::filesystem::path& path) {
    std::size_t size = 0;
    while (size < bytes.size()) {
        const ssize_t got = ::read(fd, bytes.data() + size, bytes.size() - size);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) throwErrno(path, errno, "a file that can be read");
        if (got == 0) break;
        size += static_cast<std::size_t>(got);
    }
    return size;
}

}  // namespace nerfvdb
