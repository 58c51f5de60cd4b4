// JSON files: a strict pass over the text first, for positions, double keys and depth, then the object itself.
#include "json_file.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <set>

#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/internal/input_file.h>

namespace unseen::calibration {
namespace {

using nlohmann::json;

// Bytes. The standard sensitivity table takes 6 MiB; the parsed form takes up to 25 times the file.
constexpr std::size_t largest_file = 64u << 20;
// An object with three nested arrays is the deepest a profile gets.
constexpr std::size_t deepest_nesting = 8;

// As JSON writes it, so that a key with line breaks stays on one line; long ones are cut.
std::string in_quotes(std::string_view text) {
    constexpr std::size_t longest = 60;
    std::string result = to_json(text.substr(0, longest));
    if (text.size() > longest) result.append("...");
    return result;
}

Error file_error(const std::filesystem::path& file, ErrorCode code, std::string_view problem) {
    return Error{code, file.string().append(": ").append(problem)};
}

// What is wrong with a JSON text, found without building anything from it.
class Inspector : public nlohmann::detail::json_sax_acceptor<json> {
public:
    const std::string& problem() const { return problem_; }
    std::optional<std::size_t> byte() const { return byte_; } // 1-based, of syntax errors

    bool start_array(std::size_t) { return enter(); }
    bool end_array() { return keys_.pop_back(), true; }
    bool start_object(std::size_t) { return enter(); }
    bool end_object() { return keys_.pop_back(), true; }
    bool key(std::string& key) {
        if (keys_.back().insert(key).second) return true;
        problem_ = "has the key " + in_quotes(key) + " twice: remove one";
        return false;
    }
    bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception& e) {
        byte_ = position;
        // The library's diagnosis without its tags and its position, "[json.exception...] ...: diagnosis", on one line.
        std::string_view text = e.what();
        for (const std::string_view end_of_tag : {"] ", ": "})
            if (const std::size_t end = text.find(end_of_tag); end != text.npos) text.remove_prefix(end + 2);
        problem_ = "is no valid JSON: ";
        constexpr std::size_t longest = 200;
        for (const char c : text.substr(0, longest)) {
            if (c >= ' ' && c <= '~') problem_ += c;
        }
        return false;
    }

private:
    bool enter() {
        keys_.emplace_back();
        if (keys_.size() <= deepest_nesting) return true;
        problem_ = "is nested deeper than " + std::to_string(deepest_nesting) + " levels, which no profile is";
        return false;
    }

    std::vector<std::set<std::string>> keys_; // of each open object or array
    std::string problem_;
    std::optional<std::size_t> byte_;
};

// "FILE:LINE:COLUMN" of a 1-based byte, columns in bytes: where the parser stopped, the end of what it did not expect.
std::filesystem::path place_of(std::filesystem::path file, std::string_view text, std::size_t byte) {
    const std::string_view before = text.substr(0, byte > 0 ? byte - 1 : 0);
    const auto line = 1 + std::ranges::count(before, '\n');
    const std::size_t start = before.rfind('\n') + 1; // npos + 1 is 0
    return file += ":" + std::to_string(line) + ":" + std::to_string(before.size() - start + 1);
}

Result<json> parse(const std::filesystem::path& file, const std::string& text) {
    if (const std::size_t nul = text.find('\0'); nul != text.npos) // which the parser takes for the end
        return file_error(place_of(file, text, nul + 1), ErrorCode::malformed_data, "is no valid JSON: a NUL byte");
    try {
        Inspector inspector;
        if (json::sax_parse(text, &inspector)) return json::parse(text);
        const auto place = inspector.byte() ? place_of(file, text, *inspector.byte()) : file;
        return file_error(place, ErrorCode::malformed_data, inspector.problem());
    } catch (const std::exception& e) {
        return file_error(file, ErrorCode::malformed_data, std::string("cannot be read as JSON: ").append(e.what()));
    }
}

std::string range_text(const Range& range) {
    std::string text = range.whole ? "a whole number " : "a number ";
    text.append(range.minimum_allowed ? "of at least " : "above ").append(number_text(range.minimum));
    if (std::isfinite(range.maximum)) text.append(" and at most ").append(number_text(range.maximum));
    return text;
}

bool inside(const Range& range, double value) {
    const bool above = range.minimum_allowed ? value >= range.minimum : value > range.minimum;
    return above && value <= range.maximum && std::isfinite(value) && (!range.whole || value == std::trunc(value));
}

// A value as an error quotes it.
std::string excerpt(const json& value) {
    if (value.is_array()) return "an array";
    if (value.is_object()) return "an object";
    std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
    constexpr std::size_t longest = 40;
    return text.size() > longest ? text.substr(0, longest).append("...") : text;
}

} // namespace

JsonObject::JsonObject(const std::filesystem::path& file, std::initializer_list<std::string_view> known_keys)
    : file_(file) {
    const Result<std::string> text = read_text_file(file, largest_file);
    Result<json> parsed = text ? parse(file, *text) : text.error();
    if (!parsed) {
        *state_ = parsed.error();
        return;
    }
    object_ = *std::move(parsed);
    if (object_.is_object()) check_keys(known_keys);
    else fail("must hold a JSON object, { ... }");
}

JsonObject JsonObject::child(const json& value, const std::string& place,
                             std::initializer_list<std::string_view> known_keys) const {
    JsonObject result;
    result.file_ = file_;
    result.place_ = place_ + place + ".";
    result.state_ = state_;
    if (value.is_object()) {
        result.object_ = value;
        result.check_keys(known_keys);
    } else {
        fail_at(place, "must be an object, { ... }, but is " + excerpt(value));
    }
    return result;
}

void JsonObject::check_keys(std::initializer_list<std::string_view> known_keys) const {
    for (const auto& [key, value] : object_.items()) {
        if (std::ranges::find(known_keys, key) != known_keys.end()) continue;
        std::string list;
        for (const std::string_view known : known_keys) list.append(list.empty() ? "" : ", ").append(known);
        return fail_at(key, "is unknown: use " + list);
    }
}

const json* JsonObject::find(std::string_view key) const {
    const auto found = object_.find(key);
    return *this && found != object_.end() ? &*found : nullptr;
}

void JsonObject::get(std::string_view key, std::string& value) const {
    const json* found = find(key);
    if (!found) return;
    if (!found->is_string()) return fail_at(key, "must be a string, but is " + excerpt(*found));
    value = found->get_ref<const std::string&>();
}

void JsonObject::get(std::string_view key, bool& value) const {
    const json* found = find(key);
    if (!found) return;
    if (!found->is_boolean()) return fail_at(key, "must be true or false, but is " + excerpt(*found));
    value = found->get<bool>();
}

void JsonObject::get(std::string_view key, double& value, const Range& range) const {
    if (has(key)) value = number(key, range);
}

double JsonObject::number(std::string_view key, const Range& range) const {
    const json* found = find(key);
    if (found && found->is_number() && inside(range, found->get<double>())) return found->get<double>();
    if (found) fail_at(key, "must be " + range_text(range) + ", but is " + excerpt(*found));
    else fail_at(key, "is missing: it must be " + range_text(range));
    return 0;
}

const json& JsonObject::array(std::string_view key) const {
    static const json empty = json::array();
    const json* found = find(key);
    if (found && found->is_array()) return *found;
    if (found) fail_at(key, "must be an array, but is " + excerpt(*found));
    else fail_at(key, "is missing: it must be an array");
    return empty;
}

std::vector<double> JsonObject::numbers(const json& array, const std::string& place,
                                        std::optional<std::size_t> count) const {
    if (!array.is_array()) fail_at(place, "must be an array of numbers, but is " + excerpt(array));
    else if (count && array.size() != *count)
        fail_at(place, "must have " + std::to_string(*count) + " values, but has " + std::to_string(array.size()));
    std::vector<double> values;
    for (std::size_t i = 0; i < array.size() && *this; ++i) {
        if (array[i].is_number()) values.push_back(array[i].get<double>());
        else fail_at(in_brackets(place, i), "must be a number, but is " + excerpt(array[i]));
    }
    if (!*this) values.assign(count.value_or(0), 0.0);
    return values;
}

std::vector<std::vector<double>> JsonObject::rows(const char* key, std::size_t width) const {
    std::vector<std::vector<double>> rows;
    for (const json& row : array(key)) rows.push_back(numbers(row, in_brackets(key, rows.size()), width));
    return rows;
}

void JsonObject::fail_at(std::string_view key, std::string_view problem) const {
    fail("key " + in_quotes(place_ + std::string(key)).append(" ").append(problem));
}

void JsonObject::fail(std::string_view problem, ErrorCode code) const {
    if (*this) *state_ = file_error(file_, code, problem);
}

void JsonWriter::add(std::string_view key, const std::string& json) {
    text_.append(text_.empty() ? "{\n" : ",\n").append(indent_).append(to_json(key)).append(": ").append(json);
}

void JsonWriter::add_text(std::string_view key, std::string_view text) { add(key, to_json(text)); }

Result<void> JsonWriter::write(const std::filesystem::path& file) const { return write_text(file, text_ + "\n}\n"); }

std::string to_json(std::string_view text) { return json(text).dump(-1, ' ', false, json::error_handler_t::replace); }

std::string to_json(std::span<const double> values) {
    std::string text = "[";
    for (const double value : values) text.append(text.size() > 1 ? ", " : "").append(number_text(value));
    return text.append("]");
}

std::string in_brackets(std::string_view name, std::size_t i) {
    return std::string(name).append("[").append(std::to_string(i)).append("]");
}

std::uint64_t hash_of(std::string_view bytes) {
    std::uint64_t hash = 0xcbf29ce484222325u;
    for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
    return hash;
}

Result<void> write_text(const std::filesystem::path& file, std::string_view text) {
    std::error_code ignored;
    if (!std::filesystem::exists(file, ignored) || std::filesystem::is_regular_file(file, ignored)) {
        auto whole = vdtree::AtomicFile::create(file);
        if (!whole) return whole.error();
        if (auto written = whole->write(text); !written) return written;
        return whole->commit();
    }
    errno = 0;
    std::ofstream stream(file, std::ios::binary | std::ios::trunc);
    const std::string verb = stream ? "write: " : "create: ";
    stream.write(text.data(), static_cast<std::streamsize>(text.size()));
    stream.close();
    if (stream) return {};
    return file_error(file, ErrorCode::io_failure,
                      "cannot " + verb + (errno != 0 ? std::strerror(errno) : "input/output error"));
}

} // namespace unseen::calibration
