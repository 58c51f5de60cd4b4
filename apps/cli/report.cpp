#include "report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include <unseen/vdtree/internal/csv.h>

#include "terminal.h"

namespace unseen::app {
namespace {

// Fifteen digits, the most that any double keeps: 0.12795, not 0.12794999999999998.
void shorten_numbers(Json& json) {
    if (json.is_structured())
        for (Json& element : json) shorten_numbers(element);
    if (!json.is_number_float()) return;
    char text[32];
    std::snprintf(text, sizeof text, "%.15g", json.get<double>());
    json = std::strtod(text, nullptr);
}

} // namespace

std::string json_text(const Json& json) {
    Json short_numbers = json;
    if (json.is_object() && !printed_warnings().empty()) short_numbers["warnings"] = printed_warnings();
    shorten_numbers(short_numbers);
    const std::string plain =
        short_numbers.dump(2, ' ', false, Json::error_handler_t::replace); // names may be no UTF-8
    std::string text;
    constexpr const char* digits = "0123456789abcdef";
    for (std::size_t i = 0; i < plain.size(); ++i) {
        auto code = static_cast<unsigned char>(plain[i]);
        if (code == 0xc2 && static_cast<unsigned char>(plain[i + 1]) < 0xa0)
            code = static_cast<unsigned char>(plain[++i]);
        else if (code != 0x7f) {
            text += plain[i];
            continue;
        }
        text += {'\\', 'u', '0', '0', digits[code >> 4], digits[code & 15]};
    }
    return text + "\n";
}

Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Result<JsonReport> JsonReport::open(const std::string& name, const std::string& csv) {
    JsonReport report;
    report.on_stdout_ = name == "-";
    for (const auto& [file, opened] : {std::pair(&name, &report.file_), std::pair(&csv, &report.csv_)}) {
        if (file->empty() || *file == "-") continue;
        auto created = vdtree::AtomicFile::create(*file);
        if (!created) return created.error();
        *opened = std::move(*created);
    }
    return report;
}

Result<void> JsonReport::prepare(const Json& json, const std::string& csv) {
    text_ = json_text(json);
    if (csv_)
        if (auto written = csv_->write(csv); !written) return written;
    return file_ ? file_->write(text_) : Result<void>();
}

Result<void> JsonReport::publish() {
    if (on_stdout_) std::fputs(text_.c_str(), stdout);
    if (csv_)
        if (auto done = csv_->commit(); !done) return done;
    return file_ ? file_->commit() : Result<void>();
}

Result<void> JsonReport::write(const Json& json, const std::string& csv) {
    auto prepared = prepare(json, csv);
    return prepared ? publish() : prepared;
}

std::string csv_line(std::initializer_list<Json> cells) {
    std::string line;
    for (const Json& cell : cells) {
        if (&cell != cells.begin()) line += ",";
        if (cell.is_string()) line += csv_field(cell.get<std::string>());
        else if (!cell.is_number_float()) line += cell.dump();
        else if (std::isfinite(cell.get<double>())) line += shortest(cell.get<double>());
    }
    return line + "\n";
}

void print_line(std::string_view text) {
    constexpr std::size_t longest = 4000; // bytes
    std::printf("%s\n", shortened(printable(text), longest).c_str());
}

void print_table(std::vector<std::vector<std::string>> rows) {
    constexpr std::size_t widest_cell = 200; // bytes
    for (auto& row : rows)
        for (std::string& cell : row) cell = shortened(printable(cell), widest_cell); // before it is measured
    std::vector<std::size_t> widths;
    for (const auto& row : rows) {
        widths.resize(std::max(widths.size(), row.size()));
        for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
    }
    for (const auto& row : rows) {
        std::string line;
        for (std::size_t i = 0; i < row.size(); ++i) {
            const std::string padding(widths[i] - row[i].size(), ' ');
            line += (i > 0 ? "  " : "") + (i == 0 ? row[i] + padding : padding + row[i]);
        }
        print_line(line);
    }
}

void print_markdown(const std::vector<std::vector<std::string>>& rows) {
    for (std::size_t r = 0; r < rows.size(); ++r) {
        for (const std::string& cell : rows[r]) std::printf("| %s ", printable(cell).c_str());
        std::printf("|\n");
        if (r > 0) continue;
        for (std::size_t column = 0; column < rows[r].size(); ++column) std::printf(column == 0 ? "|---" : "|---:");
        std::printf("|\n");
    }
}

Fact count_of(const std::string& key, const std::string& label, std::uint64_t count) {
    return {key, label, count, grouped(count)};
}

Json to_json(const std::vector<Fact>& facts) {
    Json json;
    for (const Fact& fact : facts)
        if (!fact.key.empty()) json[fact.key] = fact.json;
    return json;
}

void print_facts(const std::vector<Fact>& facts) {
    std::vector<std::vector<std::string>> rows;
    for (const Fact& fact : facts)
        if (!fact.label.empty()) rows.push_back({fact.label, fact.text});
    print_table(std::move(rows));
}

Json texture_json(const vdtree::VertexTree& tree) {
    const vdtree::TextureView texture = tree.texture();
    if (texture.empty()) return nullptr;
    const auto wrap = [](vdtree::Wrap w) {
        if (w == vdtree::Wrap::clamp) return "clamp";
        return w == vdtree::Wrap::mirror ? "mirror" : "repeat";
    };
    return {{"width", texture.width},
            {"height", texture.height},
            {"wrap_u", wrap(texture.wrap_u)},
            {"wrap_v", wrap(texture.wrap_v)}};
}

std::string texture_text(const vdtree::VertexTree& tree) {
    const vdtree::TextureView texture = tree.texture();
    if (texture.empty()) return "none";
    return std::to_string(texture.width) + " x " + std::to_string(texture.height);
}

Json creases_json(const vdtree::Creases& creases) {
    using Source = vdtree::Creases::Source;
    const char* const source = creases.source == Source::file    ? "file"
                               : creases.source == Source::asked ? "asked"
                                                                 : "rule";
    return {{"source", source}, {"degrees", creases.source == Source::file ? Json() : Json(creases.degrees)}};
}

std::string creases_text(const vdtree::Creases& creases) {
    using Source = vdtree::Creases::Source;
    if (creases.source == Source::file) return "as the mesh says";
    const std::string why = creases.source == Source::asked ? ", as asked" : ", as its edges suggest";
    if (creases.degrees >= 180) return "none" + why;
    return "above " + rounded(static_cast<double>(creases.degrees), 4) + " degrees" + why;
}

namespace {

// The largest weight of what folds at all.
float largest_fold_weight_of(const vdtree::VertexTree& tree) {
    float largest = 1;
    for (const float weight : tree.fold_weights())
        if (weight < vdtree::never_folds) largest = std::max(largest, weight);
    return largest;
}

} // namespace

Json protection_json(const vdtree::VertexTree& tree) {
    return {{"locked_triangles", tree.locked_triangles()}, {"largest_weight", largest_fold_weight_of(tree)}};
}

std::string protection_text(const vdtree::VertexTree& tree) {
    std::string text = tree.is_locked() ? grouped(tree.locked_triangles()) + " triangles never fold" : "";
    if (const float weight = largest_fold_weight_of(tree); weight > 1)
        text += (text.empty() ? "" : ", ") + std::string("weights up to ") + rounded(static_cast<double>(weight), 4);
    return text.empty() ? "nothing" : text;
}

} // namespace unseen::app
