// SPDX-License-Identifier: Apache-2.0
#include "core/atomic_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <new>
#include <regex>
#include <system_error>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "core/error.h"
#include "core/file_descriptor.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

/// A symbolic link stays one: its target is what gets replaced.
fs::path targetOf(const fs::path& path) {
    std::error_code ignored;
    return fs::is_symlink(path, ignored) ? fs::weakly_canonical(path, ignored) : path;
}

fs::path folderOf(const fs::path& target) {
    return target.has_parent_path() ? target.parent_path() : fs::path(".");
}

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

/// A temporary that no one else has, locked while it lives and deleted on every way out. Unique among processes and
/// threads, so that two writers of one path cannot mix their halves.
class Temporary {
public:
    Temporary(const fs::path& target, const fs::path& folder, const fs::path& path) {
        static std::atomic<unsigned> counter{0};
        do {  // one that removeOrphans took between its making and its lock is not ours any more
            fs::path name(target.stem());
            name += std::string(".").append(std::to_string(::getpid())).append("-");
            name += std::to_string(counter++) + ".part";
            name += target.extension();
            path_ = folder / name;
            file_ = std::make_unique<Descriptor>(path_, O_RDWR | O_CREAT | O_EXCL);
            if (!file_->isOpen() && errno == EEXIST) continue;  // an orphan of our own number
            if (!file_->isOpen()) throwErrno(path, errno, "a folder that can be written");
            (void)::flock(file_->get(), LOCK_EX);  // where there are no locks, orphans stay
        } while (!file_->isOpen() || !fs::exists(path_));
    }
    ~Temporary() {
        std::error_code ignored;
        fs::remove(path_, ignored);
    }
    Temporary(const Temporary&) = delete;
    Temporary& operator=(const Temporary&) = delete;
    const fs::path& path() const { return path_; }

private:
    fs::path path_;
    std::unique_ptr<Descriptor> file_;
};

std::string digitsOf(const XXH128_hash_t& hash) {
    char digits[33];
    std::snprintf(digits, sizeof digits, "%016llx%016llx", static_cast<unsigned long long>(hash.high64),
                  static_cast<unsigned long long>(hash.low64));
    return digits;
}

void replaceFile(const fs::path& path, const std::function<void(const fs::path& temporary)>& write,
                 Durable durable) {
    const fs::path target = targetOf(path), folder = folderOf(target);
    checkTarget(target, folder);
    const Temporary temporary(target, folder, path);
    try {
        write(temporary.path());
    } catch (const Error&) {
        throw;
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::system_error& error) {
        throw IoError(path.string(), error.what(), "the file to be written", adviceFor(error.code().value()));
    } catch (const std::exception& error) {
        throw IoError(path.string(), error.what(), "the file to be written");
    }

    if (durable == Durable::disk) syncToDisk(temporary.path(), path);
    if (::rename(temporary.path().c_str(), target.c_str()) != 0)
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
        writeAll(file.get(), std::as_bytes(std::span(bytes)), path);
    };
    replaceFile(path, write, durable);
}

void writePieces(const fs::path& path, const std::function<std::string(const AppendBytes& append)>& write,
                 Durable durable) {
    const auto write_file = [&](const fs::path& temporary) {
        const Descriptor file(temporary, O_WRONLY | O_TRUNC);
        if (!file.isOpen()) throwErrno(path, errno, "a folder that can be written");
        const std::string head = write([&](std::span<const std::byte> bytes) { writeAll(file.get(), bytes, path); });
        if (::lseek(file.get(), 0, SEEK_SET) != 0) throwErrno(path, errno, "a file that can be written anywhere");
        writeAll(file.get(), std::as_bytes(std::span(head)), path);
    };
    replaceFile(path, write_file, durable);
}

void removeOrphans(const fs::path& path) {
    static const std::regex kName(R"((.+)\.[0-9]+-[0-9]+\.part(\.[^.]*)?)");
    std::error_code ignored;
    const fs::path target = targetOf(path);
    const bool is_folder = fs::is_directory(target, ignored);
    for (fs::directory_iterator entry(is_folder ? target : folderOf(target), ignored), end; entry != end;
         entry.increment(ignored)) {
        const std::string name = entry->path().filename().string();
        std::smatch parts;
        if (!std::regex_match(name, parts, kName) || !entry->is_regular_file(ignored)) continue;
        if (!is_folder && (parts[1] != target.stem().string() || parts[2] != target.extension().string())) continue;
        const Descriptor file(entry->path(), O_RDWR | O_NONBLOCK | O_NOFOLLOW);
        if (file.isOpen() && ::flock(file.get(), LOCK_EX | LOCK_NB) == 0) fs::remove(entry->path(), ignored);
    }
}

std::string readFile(const fs::path& path) {
    const PlainFile file(path);
    // The size is a hint: a file may grow or shrink while it is read, and those of the system say 0.
    std::string bytes(file.size() + 1, '\0');
    std::size_t size = 0;
    for (;;) {
        size += readAll(file.get(), std::as_writable_bytes(std::span(bytes).subspan(size)), path);
        if (size < bytes.size()) break;
        bytes.resize(2 * bytes.size());
    }
    bytes.resize(size);
    return bytes;
}

std::string contentHash(std::span<const std::byte> bytes) { return digitsOf(XXH3_128bits(bytes.data(), bytes.size())); }

struct ContentHash::State {
    XXH3_state_t hash;  // aligned to 64 bytes by its type
};

ContentHash::ContentHash() : state_(std::make_unique<State>()) { XXH3_128bits_reset(&state_->hash); }
ContentHash::~ContentHash() = default;

void ContentHash::add(std::span<const std::byte> bytes) {
    XXH3_128bits_update(&state_->hash, bytes.data(), bytes.size());
}

std::string ContentHash::digits() const { return digitsOf(XXH3_128bits_digest(&state_->hash)); }

}  // namespace nerfvdb
