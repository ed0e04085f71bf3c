// SPDX-License-Identifier: Apache-2.0
// What goes wrong, in three kinds that never mix: the user's words (UsageError), the world (DataError,
// IoError), and the numbers (NumericError). The library throws; only cli/main.cpp turns it into exit codes.
// Interrupted is the fourth way out: the user asked to stop, and everything worth keeping was saved.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace nerfvdb {

/// The same with control characters, UTF-8's too, written out (\x1b, \x0a): names from files and from the command line cannot
/// colour, clear or fake a terminal's lines.
std::string printable(std::string_view text);

class Error : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;

    /// One sentence in the house's form: "WHERE: found FOUND, expected EXPECTED; ADVICE".
    /// `where` names the file and, inside it, the field. `advice` may be empty. What files say is made printable.
    Error(const std::string& where, const std::string& found, const std::string& expected,
          const std::string& advice = {});
};

struct UsageError : Error { using Error::Error; };      // exit code 2
struct DataError : Error { using Error::Error; };       // exit code 1: a file holds what it should not
struct IoError : Error { using Error::Error; };         // exit code 1: a file cannot be read or written
struct NumericError : Error { using Error::Error; };    // exit code 1: non-finite values, nothing to learn
struct Interrupted : Error { using Error::Error; };     // exit code 130, after saving

}  // namespace nerfvdb
