// Tables as text, fields between commas (RFC 4180).
#pragma once

#include <cstddef>

#include <unseen/vdtree/result.h>

namespace unseen {

// As a table has it: in quotation marks where it needs them.
inline std::string csv_field(std::string_view field) {
    if (field.find_first_of(",\"\r\n") == field.npos) return std::string(field);
    std::string text = "\"";
    for (const char c : field) text += c == '"' ? std::string("\"\"") : std::string(1, c);
    return text + "\"";
}

struct CsvRecord {
    int line = 0; // where it begins, from 1
    std::vector<std::string> fields;
};

// All records but empty lines. Fields in quotation marks may go over several lines. Errors name the line; `name` is the
// text's. Fails where a record has more than `most_fields`.
inline Result<std::vector<CsvRecord>> parse_csv(std::string_view text, const std::string& name,
                                                std::size_t most_fields) {
    const auto wrong = [&](int line, const char* what) {
        return Error{ErrorCode::malformed_data, name + ":" + std::to_string(line) + ": " + what};
    };
    std::vector<CsvRecord> records;
    int line = 1;
    for (std::size_t at = 0; at < text.size();) {
        CsvRecord record{line, std::vector<std::string>(1)};
        std::vector<std::string>& fields = record.fields;
        bool is_quoted = false, ends = false;
        while (at < text.size() && !ends) {
            const char c = text[at++];
            line += c == '\n';
            if (is_quoted) {
                if (c != '"') fields.back() += c;
                else if (at < text.size() && text[at] == '"') fields.back() += text[at++];
                else is_quoted = false;
            } else if (c == '"' && fields.back().empty()) is_quoted = true;
            else if (c == ',') fields.emplace_back();
            else if (c == '\n') ends = true;
            else if (c != '\r') fields.back() += c;
            if (fields.size() > most_fields) return wrong(record.line, "there are more fields than columns.");
        }
        if (is_quoted) return wrong(record.line, "a quotation mark is missing.");
        if (fields.size() > 1 || !fields[0].empty()) records.push_back(std::move(record));
    }
    return records;
}

} // namespace unseen
