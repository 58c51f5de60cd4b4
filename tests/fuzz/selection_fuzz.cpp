// Fuzz target for files of selected levels, the journals of searches that were interrupted, and the messages of processes
// that search together. After a byte that chooses what the others are: any bytes give an error with a message, or what
// can be used and written again. tests/README.md tells how to build and run it.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <unseen/session/internal/selections.h>

#include "memory_file.h"
#include "target.h"

namespace {

using namespace unseen;

// Sums over the content would keep all but few inputs out.
void seal(std::string& bytes) {
    constexpr std::string_view head("UNSEENSL\2\0\0\0", 12);
    if (bytes.size() < head.size() + sizeof(std::uint64_t)) return;
    std::memcpy(bytes.data(), head.data(), head.size());
    const std::size_t body = bytes.size() - sizeof(std::uint64_t);
    const std::uint64_t sum = XXH3_64bits(bytes.data(), body);
    std::memcpy(bytes.data() + body, &sum, sizeof(sum));
}

bool is_selections(const std::filesystem::path& file) {
    const auto read = session::read_selections(file);
    if (!read) {
        if (read.error().message.empty()) std::abort();
        return false;
    }
    for (const session::SelectionCell& cell : read->cells) {
        std::vector<const session::SelectionCorner*> corners;
        for (const session::LatticePoint& place : session::corners_of(read->grid, cell)) {
            corners.push_back(read->corner(place));
            if (!corners.back()) std::abort();
        }
        static_cast<void>(session::corners_differ(corners, 0.5));
    }
    return true;
}

bool is_message(std::string_view bytes) {
    const auto corner = session::corner_from(std::as_bytes(std::span(bytes)));
    if (!corner) {
        if (corner.error().message.empty()) std::abort();
        return false;
    }
    const auto again = session::to_bytes(*corner);
    if (again.size() != bytes.size() || std::memcmp(again.data(), bytes.data(), bytes.size()) != 0) std::abort();
    return true;
}

// What follows the last whole record is cut off, and a further record is found again.
bool is_journal(const std::filesystem::path& file) {
    constexpr std::uint64_t key = 0x3131313131313131; // "11111111"
    auto journal = session::SelectionJournal::open(file, key);
    if (!journal) std::abort();
    const std::size_t before = journal->done().size();
    if (!journal->add(session::SelectionCorner{})) std::abort();
    const auto again = session::SelectionJournal::open(file, key);
    if (!again || again->done().size() != before + 1) std::abort();
    return true;
}

} // namespace

bool fuzz::accepts(std::string_view input) {
    if (input.empty()) return false;
    std::string bytes(input.substr(1));
    const int reader = static_cast<unsigned char>(input[0]) % 4;
    if (reader == 1) seal(bytes);
    static fuzz::MemoryFile file;
    file.hold(bytes);
    if (reader == 2) return is_message(bytes);
    return reader == 3 ? is_journal(file.path()) : is_selections(file.path());
}
