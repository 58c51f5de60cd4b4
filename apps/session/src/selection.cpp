#include <unseen/session/selection.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <type_traits>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <unseen/session/level_chain.h>
#include <unseen/session/session.h>
#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>

namespace unseen::session {
namespace {

static_assert(std::endian::native == std::endian::little, "Files of selections are little-endian.");

constexpr std::array<char, 8> selection_magic = {'U', 'N', 'S', 'E', 'E', 'N', 'S', 'L'};
constexpr std::array<char, 8> journal_magic = {'U', 'N', 'S', 'E', 'E', 'N', 'S', 'J'};
constexpr std::uint32_t selection_version = 2;
constexpr std::uint32_t most_selected_levels = static_cast<std::uint32_t>(most_levels);

// ---- bytes
// ------------------------------------------------------------------------------------------------------------

class ByteWriter {
public:
    template <class T>
    void put(T value) {
        static_assert(std::is_trivially_copyable_v<T>);
        const auto bytes = std::as_bytes(std::span(&value, 1));
        bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    }
    std::vector<std::byte> take() { return std::move(bytes_); }

private:
    std::vector<std::byte> bytes_;
};

// Every read is checked; after the first that fails, all give 0 and error() tells.
class ByteReader {
public:
    explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

    template <class T>
    T get() {
        T value{};
        if (failure_.empty() && bytes_.size() - at_ < sizeof(T)) fail("it ends there, in the middle of a number");
        if (!failure_.empty()) return value;
        std::memcpy(&value, bytes_.data() + at_, sizeof(T));
        at_ += sizeof(T);
        return value;
    }
    // That are `least_bytes` long each, at least.
    std::uint32_t count(std::size_t least_bytes, std::uint64_t most, const char* what) {
        const auto value = get<std::uint32_t>();
        if (failure_.empty() && (value > most || value > (bytes_.size() - at_) / least_bytes))
            fail("it says that there are " + std::to_string(value) + " " + what + ", more than it has room for");
        return failure_.empty() ? value : 0;
    }
    void require(bool is_right, const char* complaint) {
        if (!is_right && failure_.empty()) fail(complaint);
    }
    bool is_right() const { return failure_.empty(); }
    bool is_at_end() const { return at_ == bytes_.size(); }
    std::string error() const { return "byte " + std::to_string(at_) + ": " + failure_; }

private:
    void fail(std::string complaint) { failure_ = std::move(complaint); }

    std::span<const std::byte> bytes_;
    std::size_t at_ = 0;
    std::string failure_;
};

void put(ByteWriter& out, const LatticePoint& p) {
    out.put(p.x);
    out.put(p.y);
    out.put(p.z);
}

LatticePoint get_point(ByteReader& in) {
    LatticePoint p;
    p.x = in.get<std::int32_t>();
    p.y = in.get<std::int32_t>();
    p.z = in.get<std::int32_t>();
    return p;
}

void put(ByteWriter& out, const SelectionCorner& corner) {
    put(out, corner.at);
    out.put(static_cast<std::uint32_t>(corner.cameras.size()));
    for (const SelectionCamera& camera : corner.cameras) {
        out.put(camera.loss);
        out.put(static_cast<std::uint32_t>(camera.objects.size()));
        for (const SelectedLevel& object : camera.objects) {
            out.put(object.object);
            out.put(object.level);
            out.put(static_cast<std::uint8_t>(object.costs.size()));
            for (const float cost : object.costs) out.put(cost);
        }
    }
}

SelectionCorner get_corner(ByteReader& in) {
    SelectionCorner corner;
    corner.at = get_point(in);
    const std::uint32_t cameras = in.count(8, selection_directions.size(), "cameras of a corner");
    for (std::uint32_t c = 0; c < cameras && in.is_right(); ++c) {
        SelectionCamera& camera = corner.cameras.emplace_back();
        camera.loss = in.get<float>();
        in.require(camera.loss >= -1 && camera.loss <= std::numeric_limits<float>::max(), "a loss is no number");
        const std::uint32_t objects = in.count(6, std::numeric_limits<std::uint32_t>::max(), "objects in sight");
        for (std::uint32_t i = 0; i < objects && in.is_right(); ++i) {
            SelectedLevel& object = camera.objects.emplace_back();
            object.object = in.get<std::uint32_t>();
            object.level = in.get<std::uint8_t>();
            const auto costs = in.get<std::uint8_t>();
            in.require(costs < most_selected_levels && object.level <= costs, "an object has no such level");
            in.require(i == 0 || camera.objects[i - 1].object < object.object, "objects are not in their order");
            for (std::uint8_t k = 0; k < costs && in.is_right(); ++k) {
                object.costs.push_back(in.get<float>());
                in.require(std::abs(object.costs.back()) <= std::numeric_limits<float>::max(),
                           "the cost of a level is no number");
            }
        }
    }
    return corner;
}

std::uint64_t hash_of(std::span<const std::byte> bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

void check_grid(const SelectionGrid& grid, ByteReader& in) {
    const auto is_finite = [](double v) { return std::abs(v) <= 1e12; };
    in.require(is_finite(grid.origin.x) && is_finite(grid.origin.y) && is_finite(grid.origin.z),
               "the grid's place is no number, or too far away");
    in.require(grid.step > 0 && grid.step <= 1e12, "the grid's step is not above 0");
    in.require(grid.depth >= 0 && grid.depth <= most_selection_depth, "cells are parted too often");
    const auto in_range = [](std::int32_t n) { return n >= 1 && n <= most_grid_cells; };
    in.require(in_range(grid.cells.x) && in_range(grid.cells.z) && (grid.cells.y == 0 || in_range(grid.cells.y)),
               "the grid has no such number of cells");
}

bool is_within(const SelectionGrid& grid, const LatticePoint& p) {
    const std::int32_t size = grid.cell_size();
    return p.x >= 0 && p.y >= 0 && p.z >= 0 && p.x <= grid.cells.x * size && p.y <= grid.cells.y * size &&
           p.z <= grid.cells.z * size;
}

} // namespace

// ---- grids
// ------------------------------------------------------------------------------------------------------------

std::vector<LatticePoint> corners_of(const SelectionGrid& grid, const SelectionCell& cell) {
    std::vector<LatticePoint> corners;
    for (const std::int32_t y : {0, 1}) {
        if (y == 1 && grid.is_on_ground()) break;
        for (const std::int32_t z : {0, 1})
            for (const std::int32_t x : {0, 1})
                corners.push_back({cell.at.x + x * cell.size, cell.at.y + y * cell.size, cell.at.z + z * cell.size});
    }
    return corners;
}

std::vector<SelectionCell> cells_of(const SelectionGrid& grid) {
    std::vector<SelectionCell> cells;
    const std::int32_t size = grid.cell_size();
    for (std::int32_t x = 0; x < grid.cells.x; ++x)
        for (std::int32_t y = 0; y < std::max(grid.cells.y, 1); ++y)
            for (std::int32_t z = 0; z < grid.cells.z; ++z) cells.push_back({{x * size, y * size, z * size}, size});
    return cells;
}

const SelectionCorner* Selections::corner(const LatticePoint& at) const {
    const auto found = std::lower_bound(corners.begin(), corners.end(), at,
                                        [](const SelectionCorner& c, const LatticePoint& p) { return c.at < p; });
    return found != corners.end() && found->at == at ? &*found : nullptr;
}

bool corners_differ(std::span<const SelectionCorner* const> corners, double levels) {
    // By object: the finest level that each corner has for it; who does not see it takes the coarsest.
    struct Seen {
        int last = 0;
        std::vector<int> by_corner;
    };
    std::map<std::uint32_t, Seen> objects;
    for (std::size_t c = 0; c < corners.size(); ++c)
        for (const SelectionCamera& camera : corners[c]->cameras)
            for (const SelectedLevel& o : camera.objects) {
                Seen& seen = objects[o.object];
                seen.last = static_cast<int>(o.costs.size());
                seen.by_corner.resize(corners.size(), most_levels);
                seen.by_corner[c] = std::min(seen.by_corner[c], static_cast<int>(o.level));
            }
    double sum = 0;
    std::size_t count = 0;
    for (auto& [object, seen] : objects) {
        for (int& level : seen.by_corner) level = std::min(level, seen.last);
        const auto [finest, coarsest] = std::minmax_element(seen.by_corner.begin(), seen.by_corner.end());
        if (*finest == seen.last) continue;
        sum += *coarsest - *finest;
        ++count;
    }
    return count > 0 && sum / static_cast<double>(count) > levels;
}

std::uint64_t scene_fingerprint(const Scene& scene, std::span<const std::vector<std::uint32_t>> triangles) {
    ByteWriter all;
    for (const Object& object : scene.objects) {
        const vdtree::Similarity& p = object.placement;
        for (const double v : {p.scale, p.rotation.w, p.rotation.x, p.rotation.y, p.rotation.z, p.translation.x,
                               p.translation.y, p.translation.z})
            all.put(v);
        all.put(object.tree.triangle_count());
    }
    for (const auto& levels : triangles) {
        all.put(static_cast<std::uint32_t>(levels.size()));
        for (const std::uint32_t count : levels) all.put(count);
    }
    return hash_of(all.take());
}

// ---- files
// ------------------------------------------------------------------------------------------------------------

std::vector<std::byte> to_bytes(const SelectionCorner& corner) {
    ByteWriter out;
    put(out, corner);
    return out.take();
}

Result<SelectionCorner> corner_from(std::span<const std::byte> bytes) {
    ByteReader in(bytes);
    SelectionCorner corner = get_corner(in);
    in.require(in.is_at_end(), "there is more than a corner");
    if (!in.is_right()) return Error{ErrorCode::malformed_data, "A corner of selections, " + in.error() + "."};
    return corner;
}

namespace {

ByteWriter head_of(const Selections& s) {
    ByteWriter out;
    for (const char c : selection_magic) out.put(c);
    out.put(selection_version);
    out.put(static_cast<std::uint32_t>(s.quality));
    out.put(s.budget);
    out.put(s.window_px);
    out.put(s.levels);
    for (const double v : {s.grid.origin.x, s.grid.origin.y, s.grid.origin.z, s.grid.step}) out.put(v);
    put(out, s.grid.cells);
    out.put(static_cast<std::int32_t>(s.grid.depth));
    out.put(s.scene);
    out.put(static_cast<std::uint32_t>(s.triangles.size()));
    for (const auto& levels : s.triangles) {
        out.put(static_cast<std::uint32_t>(levels.size()));
        for (const std::uint32_t count : levels) out.put(count);
    }
    return out;
}

} // namespace

std::uint64_t search_key(const Selections& selections) { return hash_of(head_of(selections).take()); }

Result<void> write_selections(const std::filesystem::path& file, const Selections& s) {
    ByteWriter out = head_of(s);
    out.put(static_cast<std::uint32_t>(s.corners.size()));
    for (const SelectionCorner& corner : s.corners) put(out, corner);
    out.put(static_cast<std::uint32_t>(s.cells.size()));
    for (const SelectionCell& cell : s.cells) {
        put(out, cell.at);
        out.put(cell.size);
    }
    std::vector<std::byte> bytes = out.take();
    const std::uint64_t hash = hash_of(bytes);
    const auto tail = std::as_bytes(std::span(&hash, 1));
    bytes.insert(bytes.end(), tail.begin(), tail.end());
    auto target = vdtree::AtomicFile::create(file);
    if (!target) return target.error();
    if (auto written = target->write(bytes); !written) return written;
    return target->commit();
}

Result<Selections> read_selections(const std::filesystem::path& file) {
    const auto read = read_file_or_pipe(file);
    if (!read) return read.error();
    const auto wrong = [&](const std::string& what) {
        return Error{ErrorCode::malformed_data, "'" + file.string() + "', " + what + "."};
    };
    const auto bytes = std::as_bytes(std::span(*read));
    if (bytes.size() < selection_magic.size() + 12 ||
        std::memcmp(bytes.data(), selection_magic.data(), selection_magic.size()) != 0)
        return wrong("byte 0: this is no file of selections; make one with 'unseen levels precompute'");
    std::uint32_t version = 0;
    std::memcpy(&version, bytes.data() + selection_magic.size(), sizeof(version));
    if (version != selection_version)
        return wrong("byte 8: version " + std::to_string(version) + " of the format, and this program reads " +
                     std::to_string(selection_version) + "; make it anew with 'unseen levels precompute'");
    std::uint64_t hash = 0;
    const auto body = bytes.first(bytes.size() - sizeof(hash));
    std::memcpy(&hash, bytes.data() + body.size(), sizeof(hash));
    if (hash != hash_of(body))
        return wrong("byte " + std::to_string(body.size()) + ": it is damaged or cut short, its sum does not agree");

    ByteReader in(body.subspan(selection_magic.size() + sizeof(version)));
    Selections s;
    const auto quality = in.get<std::uint32_t>();
    in.require(quality <= static_cast<std::uint32_t>(SelectionQuality::contrast), "there is no such quality");
    s.quality = static_cast<SelectionQuality>(quality);
    s.budget = in.get<std::uint64_t>();
    s.window_px = in.get<std::int32_t>();
    s.levels = in.get<std::int32_t>();
    in.require(s.budget > 0, "the budget is 0");
    in.require(s.window_px >= 11 && s.window_px <= 8192, "the window has no such size");
    in.require(s.levels >= 2 && s.levels <= most_levels, "objects have no such number of levels");
    for (const int axis : {0, 1, 2}) s.grid.origin[axis] = in.get<double>();
    s.grid.step = in.get<double>();
    s.grid.cells = get_point(in);
    s.grid.depth = in.get<std::int32_t>();
    check_grid(s.grid, in);
    s.scene = in.get<std::uint64_t>();
    const std::uint32_t objects = in.count(8, std::numeric_limits<std::uint32_t>::max(), "objects");
    for (std::uint32_t i = 0; i < objects && in.is_right(); ++i) {
        const std::uint32_t levels = in.count(4, static_cast<std::uint32_t>(s.levels), "levels of an object");
        in.require(levels > 0, "an object has no level");
        auto& counts = s.triangles.emplace_back();
        for (std::uint32_t k = 0; k < levels && in.is_right(); ++k) {
            counts.push_back(in.get<std::uint32_t>());
            in.require(k == 0 || counts[k] < counts[k - 1], "the triangles of an object's levels do not fall");
        }
    }
    const std::uint32_t corners = in.count(16, most_selection_corners, "corners");
    for (std::uint32_t c = 0; c < corners && in.is_right(); ++c) {
        s.corners.push_back(get_corner(in));
        const SelectionCorner& corner = s.corners.back();
        in.require(is_within(s.grid, corner.at), "a corner is not of the grid");
        in.require(c == 0 || s.corners[c - 1].at < corner.at, "corners are not in their order");
        in.require(corner.cameras.size() == static_cast<std::size_t>(s.directions()),
                   "a corner has not as many cameras as there are directions");
        for (const SelectionCamera& camera : corner.cameras)
            for (const SelectedLevel& o : camera.objects)
                in.require(o.object < objects && o.costs.size() + 1 == s.triangles[o.object].size(),
                           "a camera sees an object, or a level of it, that there is not");
    }
    const std::uint32_t cells = in.count(16, most_selection_corners, "cells");
    for (std::uint32_t c = 0; c < cells && in.is_right(); ++c) {
        SelectionCell cell;
        cell.at = get_point(in);
        cell.size = in.get<std::int32_t>();
        in.require(c == 0 || s.cells[c - 1] < cell, "cells are not in their order");
        in.require(cell.size > 0 && cell.size <= s.grid.cell_size() && std::has_single_bit(unsigned(cell.size)) &&
                       is_within(s.grid, cell.at),
                   "a cell is not of the grid");
        if (!in.is_right()) break;
        for (const LatticePoint& p : corners_of(s.grid, cell))
            in.require(s.corner(p) != nullptr, "a corner of a cell is missing");
        s.cells.push_back(cell);
    }
    in.require(in.is_at_end(), "something follows the last cell");
    in.require(!s.cells.empty(), "there are no cells");
    if (!in.is_right()) return wrong(in.error());
    return s;
}

// ---- journals
// ---------------------------------------------------------------------------------------------------------

Result<SelectionJournal> SelectionJournal::open(const std::filesystem::path& file, std::uint64_t key) {
    SelectionJournal journal;
    journal.file_ = file;
    constexpr std::size_t head = journal_magic.size() + sizeof(key);
    std::error_code failed;
    std::uint64_t good = 0; // bytes
    if (std::filesystem::exists(file, failed)) {
        const auto bytes = read_file_or_pipe(file);
        if (!bytes) return bytes.error();
        std::uint64_t of = 0;
        if (bytes->size() >= head) std::memcpy(&of, bytes->data() + journal_magic.size(), sizeof(of));
        if (bytes->size() >= head && std::memcmp(bytes->data(), journal_magic.data(), journal_magic.size()) == 0 &&
            of == key) {
            good = head;
            // Each record: its length, its sum, itself.
            for (;;) {
                std::uint64_t length = 0, sum = 0;
                const std::uint64_t left = bytes->size() - good;
                if (left < sizeof(length) + sizeof(sum)) break;
                std::memcpy(&length, bytes->data() + good, sizeof(length));
                std::memcpy(&sum, bytes->data() + good + sizeof(length), sizeof(sum));
                if (length > left - sizeof(length) - sizeof(sum)) break;
                const auto record =
                    std::as_bytes(std::span(*bytes)).subspan(good + sizeof(length) + sizeof(sum), length);
                if (hash_of(record) != sum) break;
                auto corner = corner_from(record);
                if (!corner) break;
                journal.done_.push_back(std::move(*corner));
                good += sizeof(length) + sizeof(sum) + length;
            }
        }
    }
    const auto cannot_write = [&] {
        return Error{ErrorCode::io_failure, "Cannot write '" + file.string() + "', which keeps what is done."};
    };
    if (good > 0) {
        std::filesystem::resize_file(file, good, failed);
        if (failed) return cannot_write();
        return journal;
    }
    std::ofstream out(file, std::ios::binary | std::ios::trunc);
    out.write(journal_magic.data(), journal_magic.size());
    out.write(reinterpret_cast<const char*>(&key), sizeof(key));
    if (!out.flush()) return cannot_write();
    return journal;
}

Result<void> SelectionJournal::add(const SelectionCorner& corner) {
    const std::vector<std::byte> record = to_bytes(corner);
    const std::uint64_t length = record.size(), sum = hash_of(record);
    std::ofstream out(file_, std::ios::binary | std::ios::app);
    out.write(reinterpret_cast<const char*>(&length), sizeof(length));
    out.write(reinterpret_cast<const char*>(&sum), sizeof(sum));
    out.write(reinterpret_cast<const char*>(record.data()), static_cast<std::streamsize>(length));
    if (!out.flush())
        return Error{ErrorCode::io_failure, "Cannot write '" + file_.string() + "', which keeps what is done."};
    return {};
}

void SelectionJournal::remove() const {
    std::error_code ignored;
    std::filesystem::remove(file_, ignored);
}

} // namespace unseen::session
