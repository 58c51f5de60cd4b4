// What a verb found out: JSON for programs, a table for people.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::app {

using Json = nlohmann::ordered_json;

// What is printed or written of a report, with a line break behind it. An object also gets the `warnings` so far.
// Control characters are escaped, also those above ASCII, which JSON would allow: nothing steers the terminal.
std::string json_text(const Json& json);

// Infinite and undefined numbers are null: JSON has neither.
Json number_or_null(double value);

// Where --json goes: nowhere (no name), stdout ("-"), or a file that appears when the report is published; and --csv,
// nowhere or to a file. Opened before the work, so that a name that cannot be written fails at once.
class JsonReport {
public:
    static Result<JsonReport> open(const std::string& name, const std::string& csv = {});

    bool is_on_stdout() const noexcept { return on_stdout_; }
    // Two steps, so that nothing can fail any more between writing the results and saying so.
    Result<void> prepare(const Json& json, const std::string& csv = {});
    Result<void> publish();
    // Both, where there is nothing else to write.
    Result<void> write(const Json& json, const std::string& csv = {});

private:
    JsonReport() = default;
    bool on_stdout_ = false;
    std::optional<vdtree::AtomicFile> file_, csv_;
    std::string text_;
};

// A line of a table in CSV: cells with commas between them. Numbers in as few digits as they need; what is not finite is
// an empty cell.
std::string csv_line(std::initializer_list<Json> cells);

// A line for people, on stdout.
void print_line(std::string_view text);

// Columns of text, the first to the left and the others to the right, for stdout.
void print_table(std::vector<std::vector<std::string>> rows);
// The same as a table of Markdown.
void print_markdown(const std::vector<std::vector<std::string>>& rows);

// What a verb found out, each fact once: by its key in JSON, by its label in a table for people; without one of them not
// there.
struct Fact {
    std::string key, label;
    Json json = {};
    std::string text = {};
};
Fact count_of(const std::string& key, const std::string& label, std::uint64_t count);
Json to_json(const std::vector<Fact>& facts);
void print_facts(const std::vector<Fact>& facts);

// A tree's texture; null or "none" if it has none.
Json texture_json(const vdtree::VertexTree& tree);
std::string texture_text(const vdtree::VertexTree& tree);
// How normals were found: {"source": "rule", "degrees": 30}; "above 30 degrees, as its edges suggest".
Json creases_json(const vdtree::Creases& creases);
std::string creases_text(const vdtree::Creases& creases);
Json protection_json(const vdtree::VertexTree& tree);
std::string protection_text(const vdtree::VertexTree& tree);

} // namespace unseen::app
