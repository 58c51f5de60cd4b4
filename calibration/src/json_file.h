// Private to calibration: JSON files in and out, with errors that name the file and the place in it. Nothing here
// throws; what the JSON library throws becomes an error.
#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include <unseen/vdtree/internal/number_text.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// The interval a number must lie in.
struct Range {
    double minimum, maximum;
    bool minimum_allowed = true; // else the number must be above it
    bool whole = false;
};
inline constexpr double unbounded = std::numeric_limits<double>::max();
inline constexpr Range positive{.minimum = 0, .maximum = unbounded, .minimum_allowed = false};
inline constexpr Range zero_to_one{.minimum = 0, .maximum = 1};

// A file that holds one object. Fails where it is larger than 64 MiB, no JSON (the error gives line and column), nested
// deeper than a profile can be, or has a key twice or one that is not in `known_keys`.
//
// Only the first failure counts, of the object and its children: after it nothing is read, numbers are 0, arrays are
// empty, and no key is there. So whatever is read in a row is checked once, at its end.
class JsonObject {
public:
    JsonObject(const std::filesystem::path& file, std::initializer_list<std::string_view> known_keys);

    // An object within this one, by its place in the file, such as "lights[0]", with keys of its own.
    JsonObject child(const nlohmann::json& value, const std::string& place,
                     std::initializer_list<std::string_view> known_keys) const;

    explicit operator bool() const { return state_->has_value(); }
    const Error& error() const { return state_->error(); }
    // "FILE: key "KEY" PROBLEM", and "FILE: PROBLEM".
    void fail_at(std::string_view key, std::string_view problem) const;
    void fail(std::string_view problem, ErrorCode code = ErrorCode::malformed_data) const;

    bool has(std::string_view key) const { return find(key) != nullptr; }
    const nlohmann::json& operator[](std::string_view key) const { return *find(key); } // precondition: has(key)

    // The value of a key, which must be of this type and within its range. get() leaves `value` as it is where the key
    // is missing.
    void get(std::string_view key, std::string& value) const;
    void get(std::string_view key, bool& value) const;
    void get(std::string_view key, double& value, const Range& range) const;
    double number(std::string_view key, const Range& range) const;
    const nlohmann::json& array(std::string_view key) const;

    // An array of numbers; `place` is its name in errors. `count`: how many there must be; as many zeros after a failure.
    std::vector<double> numbers(const nlohmann::json& array, const std::string& place,
                                std::optional<std::size_t> count = {}) const;
    // An array of such arrays.
    std::vector<std::vector<double>> rows(const char* key, std::size_t width) const;

private:
    JsonObject() = default;
    void check_keys(std::initializer_list<std::string_view> known_keys) const;
    const nlohmann::json* find(std::string_view key) const;

    std::filesystem::path file_;
    std::string place_; // of a child, with a point at its end
    nlohmann::json object_;
    std::shared_ptr<Result<void>> state_ = std::make_shared<Result<void>>(); // one for the object and its children
};

// Writes an object, a line for each key.
class JsonWriter {
public:
    // `indent`: before each key.
    explicit JsonWriter(std::string_view indent = {}) : indent_(indent) {}

    void add(std::string_view key, const std::string& json);
    void add(std::string_view key, double number) { add(key, number_text(number)); }
    void add(std::string_view key, std::integral auto number) { add(key, std::to_string(number)); }
    void add_text(std::string_view key, std::string_view text);
    Result<void> write(const std::filesystem::path& file) const;

private:
    std::string indent_, text_;
};

// A JSON string, quoted; bytes that are no UTF-8 are replaced.
std::string to_json(std::string_view text);
// "[1, 2]".
std::string to_json(std::span<const double> values);
// "name[i]".
std::string in_brackets(std::string_view name, std::size_t i);

// FNV-1a, the same on every machine.
std::uint64_t hash_of(std::string_view bytes);

// Written to a temporary name in the same folder and renamed; what is no regular file (a pipe, /dev/stdout) is written
// directly.
Result<void> write_text(const std::filesystem::path& file, std::string_view text);

} // namespace unseen::calibration
