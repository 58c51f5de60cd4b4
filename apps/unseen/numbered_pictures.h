// Pictures of frames, in files with the frames' numbers.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>

#include <unseen/perception/image.h>

namespace unseen::app {

// A name with a number: what stands before it, how many digits at least, and what stands after.
struct NamePattern {
    std::string before, after;
    std::size_t digits = 0;

    std::string with(std::size_t number) const {
        const std::string text = std::to_string(number);
        return before + std::string(digits > text.size() ? digits - text.size() : 0, '0') + text + after;
    }
};

// "frames/%04d.png"; none: it is no such name.
std::optional<NamePattern> parse_pattern(const std::string& pattern);

// A complaint about --output unless it is a pattern for names of PNGs.
std::string complaint_about_picture_names(const std::string& pattern);

// What a flight has written so far, frame by frame; of one that fails nothing is left.
class Pictures {
public:
    explicit Pictures(const std::string& pattern) : names_(parse_pattern(pattern)) {}
    Pictures(const Pictures&) = delete;
    Pictures& operator=(const Pictures&) = delete;
    ~Pictures() {
        std::error_code ignored;
        for (std::size_t frame = 0; frame < written_; ++frame) std::filesystem::remove(names_->with(frame), ignored);
    }

    Result<void> write_next(const perception::Image& image) {
        auto written = perception::write_image(names_->with(written_), image);
        if (written) ++written_;
        return written;
    }
    bool are_wanted() const { return names_.has_value(); }
    void keep() { written_ = 0; }

private:
    std::optional<NamePattern> names_;
    std::size_t written_ = 0;
};

} // namespace unseen::app
