// How every reader opens a file that it reads as a whole.
//
// Nothing waits for ever: folders, devices and sockets are refused, and so are pipes that no program writes to.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>

#include <unseen/vdtree/result.h>

namespace unseen {

// Bytes of memory in this machine: no file that is larger is read.
std::uint64_t machine_memory();

// The whole of a regular file, or its first `most_bytes`.
Result<std::string> read_regular_file(const std::filesystem::path& file,
                                      std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max());

// A file that people write or look at, or a pipe (`<(program)`, /dev/stdin). Fails if there are more than `most_bytes`.
inline constexpr std::uint64_t largest_input_bytes = std::uint64_t{4} << 30;
inline constexpr std::uint64_t largest_text_bytes = std::uint64_t{512} << 20;
Result<std::string> read_file_or_pipe(const std::filesystem::path& file,
                                      std::uint64_t most_bytes = largest_input_bytes);

// A text, without the byte order mark that spreadsheets write. "-" is the standard input.
Result<std::string> read_text_file(const std::filesystem::path& file, std::uint64_t most_bytes = largest_text_bytes);

} // namespace unseen
