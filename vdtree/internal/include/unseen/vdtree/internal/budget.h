// What may be made of a file. Instances, stretches and compression multiply it, and a small file must not take all of a
// machine's memory.
#pragma once

#include <algorithm>
#include <cstdint>

namespace unseen {

class Budget {
public:
    // So many bytes for each of the file's, and a number of bytes that any file may ask for.
    Budget(std::uint64_t file_bytes, std::uint64_t bytes_each, std::uint64_t least)
        : left_(std::max(least, bytes_each * file_bytes)) {}

    // False if there is not enough left.
    [[nodiscard]] bool spend(std::uint64_t count, std::uint64_t bytes_each = 1) {
        if (bytes_each > 0 && count > left_ / bytes_each) return false;
        left_ -= count * bytes_each;
        return true;
    }

private:
    std::uint64_t left_; // bytes
};

} // namespace unseen
