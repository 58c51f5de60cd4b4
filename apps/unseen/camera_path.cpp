#include "camera_path.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string_view>

#include <glm/geometric.hpp>
#include <unseen/vdtree/internal/csv.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_text.h>

#include "terminal.h"

namespace unseen::app {
namespace {

constexpr std::string_view orbit_prefix = "orbit:";
constexpr double least_orbit_degrees = 1e-4; // below, once around would take millions of frames

template <class Number>
bool parse(std::string_view text, Number& value) {
    const auto parsed = number_from<Number>(trimmed(text));
    if (parsed) value = *parsed;
    return parsed.has_value();
}

// ---- orbits

Result<Orbit> parse_orbit(const std::string& path) {
    const std::string_view text = std::string_view(path).substr(orbit_prefix.size());
    const std::size_t colon = text.find(':');
    double degrees = 0;
    if (!parse(text.substr(0, colon), degrees) || !(std::abs(degrees) <= 360))
        return invalid_argument("'" + path + "' must be orbit:DEGREES[:FRAMES] with -360 to 360 degrees a frame.");
    int frames = 0;
    if (colon != std::string_view::npos) {
        if (!parse(text.substr(colon + 1), frames) || frames < 1 || frames > most_path_frames)
            return invalid_argument("'" + path + "' must be orbit:DEGREES[:FRAMES] with 1 to " +
                                    std::to_string(most_path_frames) + " frames.");
    } else if (!(std::abs(degrees) >= least_orbit_degrees)) {
        return invalid_argument("'" + path + "' never comes around; say how many frames: orbit:DEGREES:FRAMES.");
    } else {
        frames = std::clamp(static_cast<int>(std::ceil(360 / std::abs(degrees))), 1, most_path_frames);
    }
    return Orbit{degrees, frames};
}

std::vector<CameraPose> poses_of(const Orbit& orbit, const vdtree::View& first) {
    std::vector<CameraPose> poses;
    poses.reserve(static_cast<std::size_t>(orbit.frames));
    for (int frame = 0; frame < orbit.frames; ++frame)
        poses.push_back({vdtree::orbited(first, orbit.degrees * frame).eye, first.target, first.up, {}});
    return poses;
}

// ---- walks

constexpr std::string_view walk_name = "walk";
constexpr double walk_frames_a_second = 60, fastest_walk = 1e6; // metres a second

bool is_walk(const std::string& path) { return path == walk_name || path.starts_with(std::string(walk_name) + ":"); }

Result<Walk> parse_walk(const std::string& path) {
    Walk walk;
    std::string_view rest = std::string_view(path).substr(walk_name.size());
    const auto next = [&] {
        rest.remove_prefix(1); // the colon
        const std::string_view text = rest.substr(0, rest.find(':'));
        rest.remove_prefix(text.size());
        return text;
    };
    const bool has_speed =
        rest.empty() || (parse(next(), walk.metres_a_second) && std::abs(walk.metres_a_second) <= fastest_walk);
    const bool has_frames =
        rest.empty() || (parse(next(), walk.frames) && walk.frames >= 1 && walk.frames <= most_path_frames);
    if (!has_speed || !has_frames || !rest.empty())
        return invalid_argument("'" + path + "' must be walk[:METRES_A_SECOND[:FRAMES]] with 1 to " +
                                std::to_string(most_path_frames) + " frames.");
    return walk;
}

std::vector<CameraPose> poses_of(const Walk& walk, const vdtree::View& first) {
    const glm::dvec3 step = walk.metres_a_second / walk_frames_a_second * glm::normalize(first.target - first.eye);
    std::vector<CameraPose> poses;
    poses.reserve(static_cast<std::size_t>(walk.frames));
    // The target goes along, so that the eye never comes to it.
    for (int frame = 0; frame < walk.frames; ++frame)
        poses.push_back({first.eye + static_cast<double>(frame) * step,
                         first.target + static_cast<double>(frame) * step,
                         first.up,
                         {}});
    return poses;
}

// ---- files

enum Column { eye_x, eye_y, eye_z, target_x, target_y, target_z, up_x, up_y, up_z, gaze_x, gaze_y, column_count };
constexpr std::array<std::string_view, column_count> column_names = {
    "eye_x", "eye_y", "eye_z", "target_x", "target_y", "target_z", "up_x", "up_y", "up_z", "gaze_x", "gaze_y"};

class PathReader {
public:
    PathReader(const std::string& file, glm::dvec3 up) : file_(file), up_(up) {}

    Result<std::vector<CameraPose>> read() {
        const auto text = read_text_file(file_);
        if (!text) return text.error();
        constexpr std::size_t most_fields = 1000;
        const auto records = parse_csv(*text, file_, most_fields);
        if (!records) return records.error();
        std::vector<CameraPose> poses;
        for (const CsvRecord& record : *records) {
            line_number_ = record.line;
            std::vector<std::string_view> cells;
            for (const std::string& field : record.fields) cells.push_back(trimmed(field));
            if (cells.size() == 1 && cells[0].empty()) continue;
            if (columns_.empty()) {
                if (auto header = read_header(cells); !header) return header.error();
                continue;
            }
            if (poses.size() == static_cast<std::size_t>(most_path_frames))
                return malformed("there are more than " + std::to_string(most_path_frames) + " frames.");
            auto pose = read_pose(cells);
            if (!pose) return pose.error();
            poses.push_back(*pose);
        }
        if (poses.empty()) return malformed("there is no frame after the header.");
        return poses;
    }

private:
    Error malformed(const std::string& what) const {
        return {ErrorCode::malformed_data, file_ + ", line " + std::to_string(line_number_) + ": " + what};
    }

    Result<void> read_header(const std::vector<std::string_view>& cells) {
        for (const std::string_view name : cells) {
            const auto found = std::find(column_names.begin(), column_names.end(), name);
            const auto column = static_cast<Column>(found - column_names.begin());
            if (column == column_count)
                return malformed("column " + std::to_string(columns_.size() + 1) + ", '" +
                                 std::string(name.substr(0, 40)) +
                                 "', is none of eye_x, eye_y, eye_z, target_x, ..., up_x, ..., gaze_x, gaze_y.");
            if (has(column)) return malformed("column '" + std::string(name) + "' comes twice.");
            columns_.push_back(column);
        }
        for (int column = eye_x; column <= target_z; ++column)
            if (!has(static_cast<Column>(column))) return missing(static_cast<Column>(column));
        for (int column = up_x; column < column_count; ++column) { // all of a group or none of it
            const Column first = column < gaze_x ? up_x : gaze_x, last = column < gaze_x ? up_z : gaze_y;
            bool any = false;
            for (int other = first; other <= last; ++other) any = any || has(static_cast<Column>(other));
            if (any && !has(static_cast<Column>(column))) return missing(static_cast<Column>(column));
        }
        return {};
    }

    bool has(Column column) const { return std::find(columns_.begin(), columns_.end(), column) != columns_.end(); }
    Error missing(Column column) const {
        return malformed("the header has no column '" + std::string(column_names[column]) + "'.");
    }

    Result<CameraPose> read_pose(const std::vector<std::string_view>& texts) const {
        if (texts.size() != columns_.size())
            return malformed("there are " + std::to_string(texts.size()) + " columns, but " +
                             std::to_string(columns_.size()) + " in the header.");
        std::array<double, column_count> v{};
        for (std::size_t i = 0; i < texts.size(); ++i)
            if (!parse(texts[i], v[columns_[i]]) || !std::isfinite(v[columns_[i]]))
                return malformed("column " + std::to_string(i + 1) + " (" + std::string(column_names[columns_[i]]) +
                                 ") must be a finite number, not '" + std::string(texts[i].substr(0, 40)) + "'.");
        CameraPose pose;
        pose.eye = {v[eye_x], v[eye_y], v[eye_z]};
        pose.target = {v[target_x], v[target_y], v[target_z]};
        pose.up = has(up_x) ? glm::dvec3(v[up_x], v[up_y], v[up_z]) : up_;
        if (has(gaze_x)) pose.gaze_px = glm::dvec2(v[gaze_x], v[gaze_y]);
        vdtree::View view; // in which it is seen does not matter here
        view.eye = pose.eye;
        view.target = pose.target;
        view.up = pose.up;
        if (auto valid = vdtree::validate(view); !valid) return malformed(valid.error().message);
        return pose;
    }

    std::string file_;
    glm::dvec3 up_;
    int line_number_ = 1;
    std::vector<Column> columns_;
};

} // namespace

Result<CameraPath> CameraPath::read(const std::string& path, glm::dvec3 up) {
    if (path == "orbit")
        return invalid_argument("say how many degrees a frame: orbit:DEGREES[:FRAMES], such as orbit:1.");
    if (path.starts_with(orbit_prefix)) {
        const auto orbit = parse_orbit(path);
        return orbit ? Result(CameraPath(*orbit)) : orbit.error();
    }
    if (is_walk(path)) {
        const auto walk = parse_walk(path);
        return walk ? Result(CameraPath(*walk)) : walk.error();
    }
    auto poses = PathReader(path, up).read();
    return poses ? Result(CameraPath(std::move(*poses))) : poses.error();
}

bool CameraPath::has_gaze() const {
    const auto* const poses = std::get_if<std::vector<CameraPose>>(&way_);
    return poses && poses->front().gaze_px;
}

std::vector<CameraPose> CameraPath::poses_from(const vdtree::View& first) const {
    if (const Orbit* const orbit = std::get_if<Orbit>(&way_)) return poses_of(*orbit, first);
    if (const Walk* const walk = std::get_if<Walk>(&way_)) return poses_of(*walk, first);
    return std::get<std::vector<CameraPose>>(way_);
}

} // namespace unseen::app
