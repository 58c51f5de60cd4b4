#include <unseen/session_gpu/precompute_selections.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <future>
#include <thread>

#include <unseen/session/internal/selections.h>
#include <unseen/session_gpu/internal/level_pictures.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/stopwatch.h>
#include <unseen/vdtree/internal/team.h>

namespace unseen::session {
namespace {

// Corners that a member does before all talk to each other again: what others did since is lost where the first is
// killed, and who is done first waits.
constexpr std::size_t corners_at_a_time = 48;
constexpr double walker_eye = 1.7; // world units above the lowest object
constexpr int default_cells = 10;  // along the longer side

Result<void> check(const PrecomputeOptions& o) {
    if (o.budget == 0) return invalid_argument("A selection needs a budget of triangles.");
    if (o.window_px < 11 || o.window_px > 8192)
        return invalid_argument("The window of a selection's cameras has 11 to 8192 pixels a side.");
    if (o.depth < 0 || o.depth > most_selection_depth)
        return invalid_argument("Cells can be parted 0 to " + std::to_string(most_selection_depth) + " times.");
    if (!(o.spacing >= 0 && o.spacing <= 1e9) || !(o.differ >= 0 && std::isfinite(o.differ)))
        return invalid_argument("The grid's spacing and how far its corners may differ are numbers from 0 on.");
    if (o.eye_height && !std::isfinite(*o.eye_height)) return invalid_argument("The eye's height is no number.");
    return {};
}

Result<SelectionGrid> grid_for(const Session& session, const PrecomputeOptions& o) {
    const Scene& scene = session.scene();
    if (scene.objects.empty()) return invalid_argument("There is nothing to select: the scene has no objects.");
    glm::dvec3 low(1e300), high(-1e300);
    double ground = 1e300;
    for (const Object& object : scene.objects) {
        const WorldSphere sphere = world_sphere(object);
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], sphere.centre[axis]);
            high[axis] = std::max(high[axis], sphere.centre[axis]);
        }
        ground = std::min(ground, sphere.centre.y - sphere.radius);
    }
    if (o.low) low = *o.low;
    if (o.high) high = *o.high;
    glm::dvec3 size = high - low;
    for (int axis = 0; axis < 3; ++axis)
        if (!std::isfinite(size[axis]) || size[axis] < 0)
            return invalid_argument("The grid's box has its low corner above its high one, or is no box.");
    double spacing = o.spacing;
    if (!(spacing > 0)) spacing = std::max({size.x, size.z, o.is_in_space ? size.y : 0.0}) / default_cells;
    if (!(spacing > 0)) spacing = 1; // one object
    SelectionGrid grid;
    grid.depth = o.depth;
    grid.step = spacing / grid.cell_size();
    std::uint64_t cells = 1;
    for (const int axis : {0, 1, 2}) {
        std::int32_t& count = axis == 0 ? grid.cells.x : axis == 1 ? grid.cells.y : grid.cells.z;
        if (axis == 1 && !o.is_in_space) {
            count = 0;
            continue;
        }
        const double needed = std::max(std::ceil(size[axis] / spacing - 1e-9), 1.0);
        if (!(needed <= most_grid_cells))
            return invalid_argument("The grid has more than " + std::to_string(most_grid_cells) +
                                    " cells along an axis: choose a larger spacing.");
        count = static_cast<std::int32_t>(needed);
        cells *= static_cast<std::uint64_t>(count);
        const double over = count * spacing - size[axis];
        low[axis] -= over / 2; // in the middle
    }
    if (cells * 2 > most_selection_corners)
        return invalid_argument("The grid has more than " + std::to_string(most_selection_corners) +
                                " corners: choose a larger spacing.");
    if (!o.is_in_space) low.y = o.eye_height ? *o.eye_height : scene.camera ? scene.camera->eye.y : ground + walker_eye;
    grid.origin = low;
    return grid;
}

vdtree::View camera_view(const Selections::Data& s, const LatticePoint& at, std::size_t direction) {
    vdtree::View view;
    view.eye = s.grid.place(at);
    view.target = view.eye + selection_directions[direction];
    view.up = std::abs(selection_directions[direction].y) > 0.5 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
    view.fov_y_degrees = 90;
    view.width = view.height = s.window_px;
    return view;
}

// Draws on this thread and searches on others, or on this one where it is the only one.
class Corners {
public:
    Corners(const Session& session, const Selections::Data& frame, LevelPictures& pictures, int threads,
            PrecomputeReport& report)
        : session_(session), frame_(frame), pictures_(pictures), report_(report),
          searching_(threads > 0 ? static_cast<std::size_t>(threads) - 1
                                 : std::max<std::size_t>(std::thread::hardware_concurrency(), 1) - 1) {}

    // One after the other, in their order. `is_done` returns whether to go on.
    template <class Done>
    Result<void> run(std::span<const LatticePoint> places, Done&& is_done) {
        const auto directions = static_cast<std::size_t>(frame_.directions());
        std::deque<std::future<Found>> open;
        SelectionCorner corner;
        std::size_t next = 0, finished = 0;
        const auto finish_one = [&]() -> Result<bool> {
            Found found = open.front().get();
            open.pop_front();
            if (!found.camera) return found.camera.error();
            report_.search_seconds += found.seconds;
            report_.evaluations += found.evaluations;
            report_.over_budget += !found.holds;
            corner.cameras.push_back(std::move(*found.camera));
            if (corner.cameras.size() < directions) return true;
            corner.at = places[finished++];
            Result<bool> goes_on = is_done(std::exchange(corner, {}));
            return goes_on;
        };
        while (finished < places.size()) {
            if (next < places.size() * directions && open.size() < searching_ + 1) {
                auto picture =
                    pictures_.draw(camera_view(frame_, places[next / directions], next % directions), frame_.quality);
                if (!picture) return picture.error(); // futures wait for their threads
                ++next;
                // On this thread it is done when it is asked for.
                open.push_back(std::async(searching_ > 0 ? std::launch::async : std::launch::deferred,
                                          [this, shown = std::move(*picture)] { return search(shown); }));
                continue;
            }
            const auto goes_on = finish_one();
            if (!goes_on) return goes_on.error();
            if (!*goes_on) return Error{ErrorCode::cancelled, "The search was stopped."};
        }
        return {};
    }

private:
    struct Found {
        Result<SelectionCamera> camera = SelectionCamera{};
        double seconds = 0;
        std::uint64_t evaluations = 0;
        bool holds = true;
    };

    Found search(const LayeredPicture& picture) const {
        const auto start = vdtree::Clock::now();
        Found result;
        const auto found =
            select_greedily(picture, frame_.quality, session_.observer().display, frame_.budget / 2, true);
        if (!found) {
            result.camera = found.error();
            return result;
        }
        SelectionCamera camera;
        camera.loss = static_cast<float>(found->loss / (static_cast<double>(picture.width) * picture.height));
        for (std::size_t i = 0; i < picture.objects.size(); ++i) {
            SelectedLevel& level = camera.objects.emplace_back();
            level.object = static_cast<std::uint32_t>(picture.objects[i].object);
            level.level = static_cast<std::uint8_t>(found->levels[i]);
            for (const double cost : found->alone[i]) level.costs.push_back(static_cast<float>(cost));
        }
        result.camera = std::move(camera);
        result.evaluations = found->evaluations;
        result.holds = found->holds;
        result.seconds = vdtree::seconds_since(start);
        return result;
    }

    const Session& session_;
    const Selections::Data& frame_;
    LevelPictures& pictures_;
    PrecomputeReport& report_;
    std::size_t searching_; // threads
};

// ---- several processes

void append(std::vector<std::byte>& to, std::span<const std::byte> bytes) {
    const std::uint64_t length = bytes.size();
    const auto head = std::as_bytes(std::span(&length, 1));
    to.insert(to.end(), head.begin(), head.end());
    to.insert(to.end(), bytes.begin(), bytes.end());
}

std::span<const std::byte> take(std::span<const std::byte>& from) {
    std::uint64_t length = 0;
    if (from.size() < sizeof(length)) return {};
    std::memcpy(&length, from.data(), sizeof(length));
    const auto bytes = from.subspan(sizeof(length), std::min<std::uint64_t>(length, from.size() - sizeof(length)));
    from = from.subspan(sizeof(length) + bytes.size());
    return bytes;
}

std::string text_of(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// What a member answers: its corners, or what went wrong behind an empty one.
Result<std::vector<SelectionCorner>> corners_of_answer(std::span<const std::byte> answer) {
    std::vector<SelectionCorner> corners;
    while (!answer.empty()) {
        const auto part = take(answer);
        if (part.empty()) return Error{ErrorCode::io_failure, "Another process: " + text_of(take(answer))};
        auto corner = corner_from(part);
        if (!corner) return corner.error();
        corners.push_back(std::move(*corner));
    }
    return corners;
}

// Does what the first member asks for, until that is nothing.
Result<void> help(Corners& corners, vdtree::Team& team) {
    for (;;) {
        const std::vector<std::byte> order = team.receive(0);
        if (order.empty()) return {};
        std::vector<LatticePoint> places(order.size() / sizeof(LatticePoint));
        std::memcpy(places.data(), order.data(), places.size() * sizeof(LatticePoint));
        std::vector<std::byte> answer;
        const auto done = corners.run(places, [&](SelectionCorner corner) {
            append(answer, to_bytes(corner));
            return Result<bool>(true);
        });
        if (!done) {
            append(answer, {});
            append(answer, std::as_bytes(std::span(done.error().message)));
        }
        team.send(0, answer);
    }
}

// All members go on or none: those that are ready say what they search for.
Result<void> agree(vdtree::Team& team, const Result<void>& ready, std::uint64_t key) {
    const auto message = [key](const Result<void>& r) {
        std::vector<std::byte> bytes;
        const std::string text = r ? "" : r.error().message;
        append(bytes, std::as_bytes(std::span(text)));
        append(bytes, std::as_bytes(std::span(&key, 1)));
        return bytes;
    };
    const std::vector<std::byte> own = message(ready);
    const auto complaint = [](std::span<const std::byte> bytes) { return text_of(take(bytes)); };
    if (team.rank() != 0) {
        team.send(0, own);
        const std::string text = complaint(team.receive(0));
        return text.empty() ? Result<void>() : Error{ErrorCode::io_failure, text};
    }
    Result<void> together = ready;
    for (int member = 1; member < team.size(); ++member) {
        const std::vector<std::byte> theirs = team.receive(member);
        const std::string text = complaint(theirs);
        if (!together) continue;
        if (!text.empty()) together = Error{ErrorCode::io_failure, "Another process: " + text};
        else if (theirs != own)
            together = Error{ErrorCode::malformed_data,
                             "Another process has another scene or other options: give all the same."};
    }
    for (int member = 1; member < team.size(); ++member) team.send(member, message(together));
    return together;
}

class FirstMember {
public:
    FirstMember(Corners& corners, vdtree::Team* team, const PrecomputeOptions& options, SelectionJournal& journal)
        : corners_(corners), team_(team && team->size() > 1 ? team : nullptr), options_(options), journal_(journal) {
        for (const SelectionCorner& corner : journal.done()) done_.emplace(corner.at, corner);
    }
    // The others wait for orders.
    ~FirstMember() {
        for (int member = 1; team_ && member < team_->size(); ++member) team_->send(member, {});
    }
    FirstMember(const FirstMember&) = delete;
    FirstMember& operator=(const FirstMember&) = delete;

    // Those that are not done yet.
    Result<void> run(const std::vector<LatticePoint>& places, const char* stage) {
        std::vector<LatticePoint> open;
        for (const LatticePoint& p : places)
            if (!done_.contains(p)) open.push_back(p);
        const std::size_t members = team_ ? static_cast<std::size_t>(team_->size()) : 1;
        std::size_t finished = places.size() - open.size();
        const auto keep = [&](SelectionCorner corner) -> Result<bool> {
            if (auto kept = journal_.add(corner); !kept) return kept.error();
            done_.insert_or_assign(corner.at, std::move(corner));
            ++finished;
            return !options_.progress ||
                   options_.progress(static_cast<double>(finished) /
                                         static_cast<double>(std::max<std::size_t>(places.size(), 1)),
                                     stage);
        };
        for (std::size_t at = 0; at < open.size();) {
            const std::size_t left = open.size() - at,
                              each = std::clamp<std::size_t>((left + members - 1) / members, 1, corners_at_a_time);
            // Neighbours cost about the same, so members take turns, to and fro: else one would have every other column
            // of the grid.
            const auto part = [&](std::size_t member) {
                std::vector<LatticePoint> own;
                for (std::size_t turn = 0; turn < each; ++turn) {
                    const std::size_t i = at + turn * members + (turn % 2 == 0 ? member : members - 1 - member);
                    if (i < open.size()) own.push_back(open[i]);
                }
                return own;
            };
            std::vector<int> asked;
            for (std::size_t member = 1; member < members; ++member) {
                const std::vector<LatticePoint> theirs = part(member);
                if (theirs.empty()) continue;
                team_->send(static_cast<int>(member), std::as_bytes(std::span(theirs)));
                asked.push_back(static_cast<int>(member));
            }
            Result<void> outcome = corners_.run(part(0), keep);
            for (const int member : asked) { // also where something failed: they are not left waiting
                const auto theirs = corners_of_answer(team_->receive(member));
                if (!theirs && outcome) outcome = theirs.error();
                if (!theirs) continue;
                for (const SelectionCorner& corner : *theirs)
                    if (const auto kept = keep(corner); outcome && !kept) outcome = kept.error();
                    else if (outcome && !*kept) outcome = Error{ErrorCode::cancelled, "The search was stopped."};
            }
            if (!outcome) return outcome;
            at += members * each;
        }
        return {};
    }

    const SelectionCorner& corner(const LatticePoint& p) const { return done_.at(p); }

private:
    Corners& corners_;
    vdtree::Team* team_;
    const PrecomputeOptions& options_;
    SelectionJournal& journal_;
    std::map<LatticePoint, SelectionCorner> done_;
};

// The children of a cell that is parted.
std::vector<SelectionCell> parts_of(const SelectionGrid& grid, const SelectionCell& cell) {
    std::vector<SelectionCell> parts;
    const std::int32_t half = cell.size / 2;
    for (const LatticePoint& p : corners_of(grid, {cell.at, half})) parts.push_back({p, half});
    return parts;
}

// Round by round: corners of all cells, then those of the parts of cells whose corners differ.
Result<void> search_all(FirstMember& first, const PrecomputeOptions& options, Selections::Data& s) {
    std::vector<SelectionCell> open = cells_of(s.grid);
    std::vector<LatticePoint> all;
    while (!open.empty()) {
        std::vector<LatticePoint> places;
        for (const SelectionCell& cell : open)
            for (const LatticePoint& p : corners_of(s.grid, cell)) places.push_back(p);
        std::sort(places.begin(), places.end());
        places.erase(std::unique(places.begin(), places.end()), places.end());
        if (places.size() > most_selection_corners)
            return invalid_argument("There are more than " + std::to_string(most_selection_corners) +
                                    " corners: choose a larger spacing, or fewer parts.");
        if (auto done = first.run(places, open.front().size == s.grid.cell_size() ? "corners" : "corners between");
            !done)
            return done;
        all.insert(all.end(), places.begin(), places.end());
        std::vector<SelectionCell> next;
        for (const SelectionCell& cell : open) {
            std::vector<const SelectionCorner*> corners;
            for (const LatticePoint& p : corners_of(s.grid, cell)) corners.push_back(&first.corner(p));
            const bool is_parted = cell.size > 1 && corners_differ(corners, options.differ);
            if (!is_parted) {
                s.cells.push_back(cell);
                continue;
            }
            const auto parts = parts_of(s.grid, cell);
            next.insert(next.end(), parts.begin(), parts.end());
        }
        open = std::move(next);
    }
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    for (const LatticePoint& p : all) s.corners.push_back(first.corner(p));
    std::sort(s.cells.begin(), s.cells.end());
    return {};
}

} // namespace

Result<PrecomputeReport> precompute_selections(const render::Context& context, Session& session,
                                               const std::filesystem::path& file, const PrecomputeOptions& options,
                                               vdtree::Team* team) {
    const auto start = vdtree::Clock::now();
    PrecomputeReport report;
    report.processes = team ? team->size() : 1;
    const bool is_first = !team || team->rank() == 0;
    Selections::Data s;
    std::optional<LevelPictures> pictures;
    std::optional<SelectionJournal> journal;
    const auto prepare = [&]() -> Result<void> {
        if (auto valid = check(options); !valid) return valid;
        auto grid = grid_for(session, options);
        if (!grid) return grid.error();
        auto made = LevelPictures::create(context, session, options.levels);
        if (!made) return made.error();
        pictures.emplace(std::move(*made));
        s = {options.quality,
             options.budget,
             options.window_px,
             options.levels,
             *grid,
             0,
             pictures->triangles(),
             {},
             {}};
        s.scene = scene_fingerprint(session.scene(), s.triangles);
        if (!is_first) return {};
        auto opened = SelectionJournal::open(file.string() + ".part", search_key(s));
        if (!opened) return opened.error();
        journal = std::move(*opened);
        report.resumed = journal->done().size();
        return {};
    };
    Result<void> ready = prepare();
    report.load_seconds = vdtree::seconds_since(start);
    if (report.processes > 1) ready = agree(*team, ready, ready ? search_key(s) : 0);
    if (!ready) return ready.error();

    Corners corners(session, s, *pictures, options.threads, report);
    if (is_first) {
        {
            FirstMember first(corners, team, options, *journal);
            if (auto done = search_all(first, options, s); !done) return done.error();
        }
        if (auto written = write_selections(file, s); !written) return written.error();
        journal->remove();
    } else if (auto helped = help(corners, *team); !helped) {
        return helped.error();
    }
    report.corners = s.corners.size();
    report.cells = s.cells.size();
    for (const SelectionCorner& corner : s.corners)
        for (const SelectionCamera& camera : corner.cameras) report.cameras += !camera.objects.empty();
    const LevelPictures::Times& times = pictures->times();
    report.seconds = vdtree::seconds_since(start);
    report.draw_seconds = times.draw_ms / 1e3;
    report.read_seconds = times.read_ms / 1e3;
    report.drawings = times.drawings;
    report.drawn_triangles = times.triangles;
    return report;
}

} // namespace unseen::session
