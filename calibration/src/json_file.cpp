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
#include <unseen/vdtree/internal/number_text.h>

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

Error system_error(const std::filesystem::path& file, std::string_view verb) {
    const std::string reason = errno != 0 ? std::strerror(errno) : "input/output error";
    return file_error(file, ErrorCode::io_failure, std::string("cannot ").append(verb).append(": ").append(reason));
}

// What is wrong with a JSON text, found without building anything from it.
class Inspector : public nlohmann::json_sax<json> {
public:
    const std::string& problem() const { return problem_; }
    std::optional<std::size_t> byte() const { return byte_; } // 1-based, of syntax errors

    bool null() override { return true; }
    bool boolean(bool) override { return true; }
    bool number_integer(number_integer_t) override { return true; }
    bool number_unsigned(number_unsigned_t) override { return true; }
    bool number_float(number_float_t, const string_t&) override { return true; }
    bool string(string_t&) override { return true; }
    bool binary(binary_t&) override { return true; }
    bool start_array(std::size_t) override { return enter(); }
    bool end_array() override { return leave(); }
    bool start_object(std::size_t) override { return enter(); }
    bool end_object() override { return leave(); }
    bool key(string_t& key) override {
        if (keys_.back().insert(key).second) return true;
        problem_ = "has the key " + in_quotes(key) + " twice: remove one";
        return false;
    }
    bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception& e) override {
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
    bool leave() {
        keys_.pop_back();
        return true;
    }

    std::vector<std::set<std::string>> keys_; // of each open object or array
    std::string problem_;
    std::optional<std::size_t> byte_;
};

// ":LINE:COLUMN" of a 1-based byte, columns in bytes: where the parser stopped, the end of what it did not expect.
std::string line_and_column(std::string_view text, std::size_t byte) {
    const std::string_view before = text.substr(0, byte > 0 ? byte - 1 : 0);
    const auto line = 1 + std::ranges::count(before, '\n');
    const std::size_t start = before.rfind('\n') == before.npos ? 0 : before.rfind('\n') + 1;
    std::string place(":");
    return place.append(std::to_string(line)).append(":").append(std::to_string(before.size() - start + 1));
}

Result<json> parse(const std::filesystem::path& file, const std::string& text) {
    if (const std::size_t nul = text.find('\0'); nul != text.npos) { // which the parser takes for the end
        std::filesystem::path place = file;
        place += line_and_column(text, nul + 1);
        return file_error(place, ErrorCode::malformed_data, "is no valid JSON: a NUL byte");
    }
    try {
        Inspector inspector;
        if (!json::sax_parse(text, &inspector)) {
            std::filesystem::path place = file;
            if (inspector.byte()) place += line_and_column(text, *inspector.byte());
            return file_error(place, ErrorCode::malformed_data, inspector.problem());
        }
        return json::parse(text);
    } catch (const std::exception& e) {
        return file_error(file, ErrorCode::malformed_data, std::string("cannot be read as JSON: ").append(e.what()));
    }
}

std::string range_text(const Range& range) {
    std::string text = range.whole ? "a whole number " : "a number ";
    text.append(range.minimum_allowed ? "of at least " : "above ").append(to_text(range.minimum));
    if (std::isfinite(range.maximum)) text.append(" and at most ").append(to_text(range.maximum));
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

Result<void> write_directly(const std::filesystem::path& file, std::string_view text) {
    errno = 0;
    std::ofstream stream(file, std::ios::binary | std::ios::trunc);
    if (!stream) return system_error(file, "create");
    stream.write(text.data(), static_cast<std::streamsize>(text.size()));
    stream.close();
    if (!stream) return system_error(file, "write");
    return {};
}

} // namespace

Result<JsonObject> JsonObject::read(const std::filesystem::path& file,
                                    std::initializer_list<std::string_view> known_keys) {
    Result<std::string> text = read_text_file(file, largest_file);
    if (!text) return text.error();
    Result<json> parsed = parse(file, *text);
    if (!parsed) return parsed.error();

    JsonObject result;
    result.file_ = file;
    result.object_ = *std::move(parsed);
    if (!result.object_.is_object()) return result.error("must hold a JSON object, { ... }");
    if (auto known = result.check_keys(known_keys); !known) return known.error();
    return result;
}

Result<JsonObject> JsonObject::child(const json& value, std::string place,
                                     std::initializer_list<std::string_view> known_keys) const {
    if (!value.is_object()) return key_error(place, "must be an object, { ... }, but is " + excerpt(value));
    JsonObject result;
    result.file_ = file_;
    result.place_ = place_ + place + ".";
    result.object_ = value;
    if (auto known = result.check_keys(known_keys); !known) return known.error();
    return result;
}

Result<void> JsonObject::check_keys(std::initializer_list<std::string_view> known_keys) const {
    for (const auto& [key, value] : object_.items()) {
        if (std::ranges::find(known_keys, key) != known_keys.end()) continue;
        std::string list;
        for (const std::string_view known : known_keys) list.append(list.empty() ? "" : ", ").append(known);
        return key_error(key, "is unknown: use " + list);
    }
    return {};
}

Result<void> JsonObject::get(std::string_view key, std::string& value) const {
    const auto found = object_.find(key);
    if (found == object_.end()) return {};
    if (!found->is_string()) return key_error(key, "must be a string, but is " + excerpt(*found));
    value = found->get_ref<const std::string&>();
    return {};
}

Result<void> JsonObject::get(std::string_view key, bool& value) const {
    const auto found = object_.find(key);
    if (found == object_.end()) return {};
    if (!found->is_boolean()) return key_error(key, "must be true or false, but is " + excerpt(*found));
    value = found->get<bool>();
    return {};
}

Result<void> JsonObject::get(std::string_view key, double& value, const Range& range) const {
    if (!has(key)) return {};
    const Result<double> number_ = number(key, range);
    if (!number_) return number_.error();
    value = *number_;
    return {};
}

Result<double> JsonObject::number(std::string_view key, const Range& range) const {
    const auto found = object_.find(key);
    if (found == object_.end()) return key_error(key, "is missing: it must be " + range_text(range));
    if (found->is_number() && inside(range, found->get<double>())) return found->get<double>();
    return key_error(key, "must be " + range_text(range) + ", but is " + excerpt(*found));
}

Result<const json*> JsonObject::array(std::string_view key) const {
    const auto found = object_.find(key);
    if (found == object_.end()) return key_error(key, "is missing: it must be an array");
    if (!found->is_array()) return key_error(key, "must be an array, but is " + excerpt(*found));
    return &*found;
}

Result<void> JsonObject::append_numbers(const json& array, const std::string& place, std::optional<std::size_t> count,
                                        std::vector<double>& values) const {
    if (!array.is_array()) return key_error(place, "must be an array of numbers, but is " + excerpt(array));
    if (count && array.size() != *count) {
        return key_error(place,
                         "must have " + std::to_string(*count) + " values, but has " + std::to_string(array.size()));
    }
    for (std::size_t i = 0; i < array.size(); ++i) {
        if (!array[i].is_number()) {
            return key_error(place + "[" + std::to_string(i) + "]", "must be a number, but is " + excerpt(array[i]));
        }
        values.push_back(array[i].get<double>());
    }
    return {};
}

Error JsonObject::key_error(std::string_view key, std::string_view problem) const {
    return error("key " + in_quotes(place_ + std::string(key)).append(" ").append(problem));
}

Error JsonObject::error(std::string_view problem) const {
    return file_error(file_, ErrorCode::malformed_data, problem);
}

std::string to_text(double value) { return number_text(value); }

std::string to_json(std::string_view text) { return json(text).dump(-1, ' ', false, json::error_handler_t::replace); }

Result<void> write_text(const std::filesystem::path& file, std::string_view text) {
    std::error_code ignored;
    if (std::filesystem::exists(file, ignored) && !std::filesystem::is_regular_file(file, ignored)) {
        return write_directly(file, text);
    }
    auto whole = vdtree::AtomicFile::create(file);
    if (!whole) return whole.error();
    if (auto written = whole->write(text); !written) return written;
    return whole->commit();
}

} // namespace unseen::calibration
