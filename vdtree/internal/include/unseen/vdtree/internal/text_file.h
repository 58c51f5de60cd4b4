// Text that is read as a whole: tables, traces, paths.
#pragma once

#include <cstddef>
#include <filesystem>
#include <istream>
#include <string>

#include <unseen/vdtree/result.h>

namespace unseen {

// More is no such text, and devices never end. Pictures from devices and pipes are held to it, too.
inline constexpr std::size_t largest_text_bytes = std::size_t{512} << 20;

// The text of a file or a pipe, without a byte order mark, which spreadsheets write. Fails on what cannot be opened or
// read to its end, on folders, and on more than `most_bytes`.
Result<std::string> read_text_file(const std::filesystem::path& file, std::size_t most_bytes = largest_text_bytes);

// The same of a stream, which errors call `name`.
Result<std::string> read_text(std::istream& stream, const std::string& name,
                              std::size_t most_bytes = largest_text_bytes);

} // namespace unseen
