// Private to calibration: JSON files in and out, with errors that name the file and the place in it. Nothing here
// throws; what the JSON library throws becomes an error.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// The interval a number must lie in.
struct Range {
    double minimum, maximum;
    bool minimum_allowed = true; // else the number must be above it
    bool whole = false;
};

// A file that holds one object. Reading fails where it is larger than 64 MiB, no JSON (the error gives line and
// column), nested deeper than a profile can be, or has a key twice or one that is not in `known_keys`.
class JsonObject {
public:
    static Result<JsonObject> read(const std::filesystem::path& file,
                                   std::initializer_list<std::string_view> known_keys);

    // An object within this one, by its place in the file, such as "lights[0]", with keys of its own.
    Result<JsonObject> child(const nlohmann::json& value, std::string place,
                             std::initializer_list<std::string_view> known_keys) const;

    bool has(std::string_view key) const { return object_.contains(key); }
    const nlohmann::json& operator[](std::string_view key) const {
        return *object_.find(key);
    } // precondition: has(key)

    // The value of a key, or an error where it is of another type or outside of its range. The first three leave `value`
    // as it is where the key is missing.
    Result<void> get(std::string_view key, std::string& value) const;
    Result<void> get(std::string_view key, bool& value) const;
    Result<void> get(std::string_view key, double& value, const Range& range) const;
    Result<double> number(std::string_view key, const Range& range) const;
    Result<const nlohmann::json*> array(std::string_view key) const;

    // Appends an array of numbers; `place` is its name in errors. `count`: how many there must be.
    Result<void> append_numbers(const nlohmann::json& array, const std::string& place, std::optional<std::size_t> count,
                                std::vector<double>& values) const;

    // "FILE: key "KEY" PROBLEM", and "FILE: PROBLEM".
    Error key_error(std::string_view key, std::string_view problem) const;
    Error error(std::string_view problem) const;

private:
    Result<void> check_keys(std::initializer_list<std::string_view> known_keys) const;

    std::filesystem::path file_;
    std::string place_; // of a child, with a point at its end
    nlohmann::json object_;
};

// Shortest text that reads back as the same number.
std::string to_text(double value);
// A JSON string, quoted; bytes that are no UTF-8 are replaced.
std::string to_json(std::string_view text);

// Written to a temporary name in the same folder and renamed; what is no regular file (a pipe, /dev/stdout) is written
// directly.
Result<void> write_text(const std::filesystem::path& file, std::string_view text);

} // namespace unseen::calibration
