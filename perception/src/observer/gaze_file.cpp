// Gazes from the tables that trackers' programs write, and to a file.
#include <algorithm>
#include <cmath>
#include <limits>

#include <unseen/perception/gaze.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_text.h>

namespace unseen::perception {
namespace {

constexpr double farthest_share = 50; // windows aside; as pixels of a large window still within farthest_px
constexpr double least_share = -0.5, largest_share = 1.5; // of positions whose names say no unit
constexpr double slowest_tracker_s = 0.1;                 // between rows

// ---- names of columns

enum class Unit {
    none,
    seconds,
    milliseconds,
    microseconds,
    nanoseconds,
    pixels,
    share,    // of the screen, 0..1 from the top left
    share_up, // from the bottom left
    media_pixels,
    media_share,
    other
};

enum class Role {
    time,
    x,
    y,
    confidence,
    tobii_validity, // Valid, or 0 and 1 of 0..4
    validity,       // 1: seen
    blink,          // 1: not seen
    worn,           // 0: not seen
    blink_id,       // not seen where there is one
    on_surface,     // of Pupil's positions on a surface, whose y points up
    eyelink,        // EyeLink's reports begin with it
    ignored
};

enum class Eye { both, left, right };

struct Column {
    std::string name; // as in the file, for errors
    Role role = Role::ignored;
    Eye eye = Eye::both;
    Unit unit = Unit::none;
    std::size_t rank = 0;  // of times: the lowest is taken
    bool is_clock = false; // of times: from an instant that has nothing to do with the first frame
    bool is_scene = false; // a position in the picture of the head's camera
};

constexpr std::pair<std::string_view, Unit> unit_names[] = {
    {"s", Unit::seconds},        {"sec", Unit::seconds},        {"seconds", Unit::seconds},
    {"ms", Unit::milliseconds},  {"us", Unit::microseconds},    {"ns", Unit::nanoseconds},
    {"px", Unit::pixels},        {"pixels", Unit::pixels},      {"dacspx", Unit::pixels},
    {"adcspx", Unit::pixels},    {"norm", Unit::share},         {"normalized", Unit::share},
    {"normalised", Unit::share}, {"adcs", Unit::share},         {"adcsnorm", Unit::share},
    {"dacsnorm", Unit::share},   {"mcspx", Unit::media_pixels}, {"mcsnorm", Unit::media_share},
};

struct TimeName {
    std::string_view name;
    Unit unit; // where the name says none
    bool is_clock;
};

// The first that a file has is taken.
constexpr TimeName time_names[] = {
    {"time", Unit::none, false},
    {"t", Unit::none, false},
    {"recordingtimestamp", Unit::milliseconds, false}, // Tobii Studio, and Pro Lab before it named its units
    {"gazetimestamp", Unit::seconds, true},            // Pupil Core
    {"worldtimestamp", Unit::seconds, true},           // Pupil Core
    {"timestamp", Unit::none, true},                   // Pupil Labs Neon, EyeLink
    {"eyetrackertimestamp", Unit::microseconds, true}, // Tobii
    {"devicetimestamp", Unit::microseconds, true},     // Tobii Pro SDK
    {"systemtimestamp", Unit::microseconds, true},     // Tobii Pro SDK
    {"computertimestamp", Unit::microseconds, true},   // Tobii Pro Lab
};

struct FlagName {
    std::string_view name;
    Role role;
    Eye eye;
};

constexpr FlagName flag_names[] = {
    {"confidence", Role::confidence, Eye::both},
    {"validityleft", Role::tobii_validity, Eye::left},
    {"validityright", Role::tobii_validity, Eye::right},
    {"leftgazepointvalidity", Role::validity, Eye::left},
    {"rightgazepointvalidity", Role::validity, Eye::right},
    {"leftinblink", Role::blink, Eye::left},
    {"rightinblink", Role::blink, Eye::right},
    {"worn", Role::worn, Eye::both},
    {"blinkid", Role::blink_id, Eye::both},
    {"onsurf", Role::on_surface, Eye::both},
    {"recordingsessionlabel", Role::eyelink, Eye::both},
};

// Lower case; both letters that are written for micro become u.
std::string lower_case(std::string_view text) {
    std::string lower;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const std::string_view pair = text.substr(i, 2);
        if (pair == "\xc2\xb5" || pair == "\xce\xbc") {
            lower += 'u';
            ++i;
        } else {
            lower += text[i] >= 'A' && text[i] <= 'Z' ? static_cast<char>(text[i] - 'A' + 'a') : text[i];
        }
    }
    return lower;
}

std::string without_separators(std::string text) {
    std::erase_if(text, [](char c) { return c == ' ' || c == '_' || c == '-' || c == '.'; });
    return text;
}

Unit unit_named(std::string_view name, Unit otherwise) {
    for (const auto& [text, unit] : unit_names)
        if (text == name) return unit;
    return otherwise;
}

bool take_out(std::string& text, std::string_view part) {
    const std::size_t at = text.find(part);
    if (at == text.npos) return false;
    text.erase(at, part.size());
    return true;
}

bool is_time(Unit unit) { return unit >= Unit::seconds && unit <= Unit::nanoseconds; }

Column column_named(std::string_view name) {
    Column column;
    column.name = name.substr(0, 40);
    std::string words = lower_case(name);
    // The unit stands in brackets at the end, or behind the last separator.
    if (const std::size_t bracket = words.find_first_of("[("); bracket != words.npos) {
        std::string unit = without_separators(words.substr(bracket));
        std::erase_if(unit, [](char c) { return c == '[' || c == ']' || c == '(' || c == ')'; });
        column.unit = unit_named(unit, Unit::other);
        words.resize(bracket);
    } else if (const std::size_t separator = words.find_last_of(" _"); separator != words.npos && separator > 0) {
        column.unit = unit_named(std::string_view(words).substr(separator + 1), Unit::none);
        if (column.unit != Unit::none) words.resize(separator);
    }
    words = without_separators(words);

    for (const FlagName& flag : flag_names)
        if (words == flag.name) {
            column.role = flag.role;
            column.eye = flag.eye;
            return column;
        }
    for (const TimeName& time : time_names)
        if (words == time.name && (column.unit == Unit::none || is_time(column.unit))) {
            column.role = Role::time;
            if (column.unit == Unit::none) column.unit = time.unit;
            column.rank = static_cast<std::size_t>(&time - time_names);
            column.is_clock = time.is_clock;
            return column;
        }
    if (is_time(column.unit) || column.unit == Unit::other) return column;
    if (take_out(words, "left")) column.eye = Eye::left;
    else if (take_out(words, "right")) column.eye = Eye::right;
    if (take_out(words, "ondisplayarea")) column.unit = Unit::share; // Tobii Pro SDK
    if (take_out(words, "normpos")) {                                // Pupil Core
        column.unit = Unit::share_up;
        column.is_scene = true;
    }
    for (const std::string_view word : {"average", "gaze", "point"}) take_out(words, word);
    if (words == "x") column.role = Role::x;
    if (words == "y") column.role = Role::y;
    return column;
}

// ---- cells

bool is_missing(std::string_view cell) {
    if (!cell.empty() && cell.front() >= '0' && cell.front() <= '9') return false; // nearly always
    const std::string text = lower_case(cell);
    return text.empty() || text == "." || text == "-" || text == "na" || text == "n/a" || text == "null" ||
           text == "nan" || text == "-nan" || text.starts_with("nan(");
}

// Up to the next separator that is not in quotes.
std::size_t end_of_cell(std::string_view line, char separator) {
    std::size_t from = 0;
    if (line.starts_with('"'))
        while ((from = line.find('"', from + 1)) != line.npos && line.substr(from + 1).starts_with('"')) ++from;
    return line.find(separator, from == line.npos ? 0 : from);
}

std::string_view unquoted(std::string_view cell) {
    cell = trimmed(cell);
    return cell.size() >= 2 && cell.front() == '"' && cell.back() == '"' ? trimmed(cell.substr(1, cell.size() - 2))
                                                                         : cell;
}

double units_per_second(Unit unit) {
    switch (unit) {
    case Unit::milliseconds: return 1e3;
    case Unit::microseconds: return 1e6;
    case Unit::nanoseconds: return 1e9;
    default: return 1;
    }
}

// ---- the file

class GazeFileReader {
public:
    explicit GazeFileReader(const std::filesystem::path& file) : file_(file.string()) {}

    Result<GazeRecording> read(std::string_view text) {
        while (!text.empty()) {
            const std::size_t end = std::min(text.find('\n'), text.size());
            std::string_view line = text.substr(0, end);
            text.remove_prefix(std::min(end + 1, text.size()));
            ++line_number_;
            if (line.ends_with('\r')) line.remove_suffix(1);
            if (trimmed(line).empty() || line.starts_with('#')) continue;
            if (auto ok = columns_.empty() ? read_header(line) : read_row(line); !ok) return ok.error();
        }
        if (samples_.empty()) return malformed("there is no sample");
        return recording();
    }

private:
    struct EyeColumns {
        std::size_t x, y;
        std::vector<std::size_t> flags;
    };

    Error malformed(const std::string& what) const {
        return {ErrorCode::malformed_data, file_ + ": line " + std::to_string(line_number_) + ": " + what + "."};
    }
    Error malformed(std::size_t column, const std::string& what) const {
        return malformed("column " + std::to_string(column + 1) + ", '" + columns_[column].name + "', " + what);
    }

    void split(std::string_view line) {
        cells_.clear();
        for (std::size_t end = 0; end != line.npos;) {
            end = end_of_cell(line, separator_);
            cells_.push_back(unquoted(line.substr(0, end)));
            if (end != line.npos) line.remove_prefix(end + 1);
        }
    }

    Result<void> read_header(std::string_view line) {
        if (line.find('\0') != line.npos) return malformed("this is no UTF-8: save the table as text in UTF-8");
        separator_ = line.find('\t') != line.npos ? '\t' : line.find(';') != line.npos ? ';' : ',';
        split(line);
        for (const std::string_view cell : cells_) columns_.push_back(column_named(cell));
        if (auto found = choose_time(); !found) return found;
        return choose_positions();
    }

    std::string names_in_file() const {
        std::string names;
        constexpr std::size_t shown = 12;
        for (std::size_t i = 0; i < std::min(columns_.size(), shown); ++i)
            names += (i > 0 ? ", '" : "'") + columns_[i].name + "'";
        return columns_.size() > shown ? names + ", ..." : names;
    }

    bool has(Role role) const {
        return std::any_of(columns_.begin(), columns_.end(), [&](const Column& c) { return c.role == role; });
    }

    Result<void> choose_time() {
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            if (columns_[i].role != Role::time) continue;
            if (time_ && columns_[i].rank == columns_[*time_].rank)
                return malformed(i, "says the same as column " + std::to_string(*time_ + 1) + ": rename one of them");
            if (!time_ || columns_[i].rank < columns_[*time_].rank) time_ = i;
        }
        if (!time_) return malformed("no column is the time: name it time_s or time_ms; there are " + names_in_file());
        Column& time = columns_[*time_];
        if (time.unit == Unit::none && has(Role::eyelink)) time.unit = Unit::milliseconds;
        return {};
    }

    // The columns of an eye whose names say this unit.
    Result<std::optional<EyeColumns>> columns_of(Eye eye, Unit unit) const {
        std::optional<std::size_t> x, y;
        std::vector<std::size_t> flags;
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            const Column& column = columns_[i];
            if (column.eye != eye && column.eye != Eye::both) continue;
            if (column.role >= Role::confidence && column.role <= Role::blink_id) flags.push_back(i);
            if (column.eye != eye || (column.role != Role::x && column.role != Role::y) || column.unit != unit)
                continue;
            std::optional<std::size_t>& axis = column.role == Role::x ? x : y;
            if (axis)
                return malformed(i, "says the same as column " + std::to_string(*axis + 1) + ": rename one of them");
            axis = i;
        }
        if (!x || !y) return std::optional<EyeColumns>();
        return std::optional(EyeColumns{*x, *y, std::move(flags)});
    }

    Result<void> choose_positions() {
        for (const Unit unit :
             {Unit::pixels, Unit::none, Unit::share, Unit::share_up, Unit::media_pixels, Unit::media_share}) {
            for (const std::vector<Eye>& eyes : {std::vector{Eye::both}, std::vector{Eye::left, Eye::right}}) {
                for (const Eye eye : eyes) {
                    auto found = columns_of(eye, unit);
                    if (!found) return found.error();
                    if (*found) eyes_.push_back(std::move(**found));
                }
                if (eyes_.empty()) continue;
                unit_ = unit == Unit::share && has(Role::on_surface) ? Unit::share_up : unit;
                return {};
            }
        }
        return malformed(
            "no two columns are the position: name them x_px and y_px, or x_norm and y_norm where they run "
            "from 0 to 1; there are " +
            names_in_file());
    }

    // Nothing where there is no number.
    Result<std::optional<double>> number_at(std::size_t column) const {
        const std::string_view cell = cells_[column];
        if (is_missing(cell)) return std::optional<double>();
        auto value = finite_from(cell);
        if (!value && separator_ != ',' && cell.find(',') != cell.npos) { // a decimal comma
            std::string text(cell);
            text[text.find(',')] = '.';
            value = finite_from(text);
        }
        if (!value)
            return malformed(column, "is no finite number: '" + std::string(cell.substr(0, 40)) +
                                         "'; leave it empty where the eye was not seen");
        return value;
    }

    Result<bool> is_seen_by(std::size_t column) const {
        const Role role = columns_[column].role;
        if (role == Role::blink_id) return is_missing(cells_[column]);
        const std::string word = lower_case(cells_[column]);
        const bool is_yes = word == "valid" || word == "true", is_no = word == "invalid" || word == "false";
        if (role != Role::confidence && (is_yes || is_no)) return is_yes != (role == Role::blink);
        const auto number = number_at(column);
        if (!number) return number.error();
        if (!*number) return role == Role::blink;
        const double value = **number;
        if (role == Role::confidence && !(value >= 0 && value <= 1))
            return malformed(column, "must be within 0..1, and is " + number_text(value));
        switch (role) {
        case Role::confidence: return value >= least_confidence;
        case Role::tobii_validity: return value <= 1;
        case Role::blink: return value == 0;
        default: return value != 0;
        }
    }

    // Nothing where the eye is not seen.
    Result<std::optional<glm::dvec2>> position_of(const EyeColumns& eye) const {
        for (const std::size_t flag : eye.flags) {
            const auto seen = is_seen_by(flag);
            if (!seen) return seen.error();
            if (!*seen) return std::optional<glm::dvec2>();
        }
        glm::dvec2 position(0);
        for (const int axis : {0, 1}) {
            const std::size_t column = axis == 0 ? eye.x : eye.y;
            const auto value = number_at(column);
            if (!value) return value.error();
            if (!*value) return std::optional<glm::dvec2>();
            const double farthest = is_normalised() ? farthest_share : GazeTrace::farthest_px;
            if (!(std::abs(**value) <= farthest))
                return malformed(column, "is " + number_text(**value) + ": at most " + number_text(farthest) +
                                             (is_normalised() ? " windows" : " pixels") + " aside can be");
            position[axis] = **value;
        }
        return std::optional(position);
    }

    Result<void> read_row(std::string_view line) {
        split(line);
        // Some programs end their rows with a separator.
        while (cells_.size() > columns_.size() && cells_.back().empty()) cells_.pop_back();
        if (cells_.size() != columns_.size())
            return malformed("there are " + std::to_string(cells_.size()) + " cells, and the header names " +
                             std::to_string(columns_.size()));
        const auto time = number_at(*time_);
        if (!time) return time.error();
        if (!*time) return malformed(*time_, "has no time");
        if (samples_.empty()) first_time_ = **time;
        const Column& clock = columns_[*time_];
        GazeTrace::Sample sample;
        sample.time_s = (**time - (clock.is_clock ? first_time_ : 0)) / units_per_second(clock.unit);

        glm::dvec2 sum(0);
        int seen = 0;
        for (const EyeColumns& eye : eyes_) {
            const auto position = position_of(eye);
            if (!position) return position.error();
            if (!*position) continue;
            sum += **position;
            ++seen;
        }
        sample.px = seen > 0 ? sum / static_cast<double>(seen) : glm::dvec2(std::numeric_limits<double>::quiet_NaN());
        return append(sample);
    }

    Result<void> append(const GazeTrace::Sample& sample) {
        if (samples_.size() == GazeTrace::most_samples) return malformed("there are more than ten million samples");
        if (!samples_.empty()) {
            GazeTrace::Sample& before = samples_.back();
            const double step_s = sample.time_s - before.time_s;
            if (step_s == 0) {
                if (is_seen(sample)) before = sample;
                return {};
            }
            if (step_s < 0)
                return malformed(*time_, "falls: " + number_text(sample.time_s) + " s comes after " +
                                             number_text(before.time_s) + " s; sort the rows by it");
            if (!(step_s <= GazeTrace::longest_gap_s))
                return malformed(*time_, "leaves a gap of " + number_text(step_s) + " s: at most 1 s may be missing" +
                                             advice_on_unit());
        }
        samples_.push_back(sample);
        return {};
    }

    bool has_time_unit() const { return columns_[*time_].unit != Unit::none; }
    std::string advice_on_unit() const {
        if (has_time_unit()) return {};
        return "; the name says no unit, so it was read as seconds: name it time_ms where it counts milliseconds, or "
               "time_s";
    }

    static bool is_seen(const GazeTrace::Sample& sample) { return !std::isnan(sample.px.x); }
    bool is_normalised() const { return unit_ == Unit::share || unit_ == Unit::share_up || unit_ == Unit::media_share; }

    // The last position holds in gaps, the first before it. Precondition: one is seen.
    void bridge_gaps() {
        std::size_t lost = 0;
        double longest_s = 0, seen_s = samples_.front().time_s;
        const auto measure_gap = [&](double end_s) {
            const double gap_s = end_s - seen_s;
            if (gap_s > longest_blink_s) ++lost;
            longest_s = std::max(longest_s, gap_s);
        };
        glm::dvec2 held = std::find_if(samples_.begin(), samples_.end(), is_seen)->px;
        bool is_gap = false;
        for (GazeTrace::Sample& sample : samples_) {
            if (is_seen(sample)) {
                if (is_gap) measure_gap(sample.time_s);
                held = sample.px;
                seen_s = sample.time_s;
                is_gap = false;
            } else {
                sample.px = held;
                is_gap = true;
            }
        }
        if (is_gap) measure_gap(samples_.back().time_s);
        if (lost > 0)
            notes_.push_back((lost == 1 ? "1 gap is" : std::to_string(lost) + " gaps are") + " longer than a blink (" +
                             number_text(longest_blink_s) + " s), the longest " +
                             number_text(std::round(longest_s * 1000) / 1000) +
                             " s: the last position holds until the eye is seen again.");
    }

    void note_what_was_assumed() {
        const Column &time = columns_[*time_], &x = columns_[eyes_.front().x], &y = columns_[eyes_.front().y];
        if (time.is_clock && first_time_ != 0)
            notes_.push_back("times count from its first row, not by '" + time.name + "'.");
        if (unit_ == Unit::none && std::all_of(samples_.begin(), samples_.end(), [](const GazeTrace::Sample& s) {
                return !is_seen(s) ||
                       (std::min(s.px.x, s.px.y) >= least_share && std::max(s.px.x, s.px.y) <= largest_share);
            })) {
            unit_ = Unit::share;
            notes_.push_back(
                "'" + x.name + "' and '" + y.name +
                "' name no unit, and all are within -0.5..1.5: they are taken as shares of the window. Name "
                "them x_px and y_px where they are pixels, or x_norm and y_norm.");
        }
        if (x.is_scene || has(Role::worn))
            notes_.push_back(
                "'" + x.name + "' and '" + y.name +
                "' are positions in the picture of the head's camera, and are taken as ones in the window.");
    }

    Result<GazeRecording> recording() {
        const auto steps = static_cast<double>(samples_.size() - 1);
        if (!has_time_unit() && samples_.back().time_s - samples_.front().time_s > slowest_tracker_s * steps)
            return malformed(*time_, "has less than ten rows a second" + advice_on_unit());
        if (std::none_of(samples_.begin(), samples_.end(), is_seen))
            return malformed("no row has a position that is seen: look at columns " +
                             std::to_string(eyes_.front().x + 1) + " and " + std::to_string(eyes_.front().y + 1) +
                             ", and at the confidence or validity, if there is one");
        note_what_was_assumed();
        bridge_gaps();
        if (unit_ == Unit::share_up)
            for (GazeTrace::Sample& sample : samples_) sample.px.y = 1 - sample.px.y;
        auto trace = GazeTrace::create(std::move(samples_));
        if (!trace) return trace.error();
        return GazeRecording{std::move(*trace), is_normalised(), std::move(notes_)};
    }

    std::string file_;
    std::size_t line_number_ = 0;
    char separator_ = ',';
    std::vector<Column> columns_;
    std::vector<std::string_view> cells_; // of the line that is being read
    std::optional<std::size_t> time_;
    std::vector<EyeColumns> eyes_;
    Unit unit_ = Unit::none;                 // of the positions
    double first_time_ = 0;                  // in the column's unit
    std::vector<GazeTrace::Sample> samples_; // positions are NaN where the eye is not seen
    std::vector<std::string> notes_;
};

} // namespace

Result<GazeTrace> GazeRecording::in_window(int width_px, int height_px) const {
    if (!is_normalised) return trace;
    std::vector<GazeTrace::Sample> samples = trace.samples();
    for (GazeTrace::Sample& sample : samples) sample.px *= glm::dvec2(width_px, height_px);
    return GazeTrace::create(std::move(samples));
}

Result<GazeRecording> read_gaze_recording(const std::filesystem::path& file) {
    const auto text = read_text_file(file);
    if (!text) return text.error();
    return GazeFileReader(file).read(*text);
}

} // namespace unseen::perception
