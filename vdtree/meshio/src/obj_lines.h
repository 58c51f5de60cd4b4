// Lines of OBJ files that several corners refer to.
#pragma once

#include "file_output.h"
#include "weld.h"

namespace unseen::meshio {

// Equal values have one line.
class ObjLines {
public:
    template <class Vector>
    explicit ObjLines(std::span<const Vector> values)
        : ObjLines(find_first_same(
              values.size(), [&](SeededHash& hash, std::size_t i) { add_bits(hash, values, i); },
              [&](std::size_t a, std::size_t b) { return has_same_bits(values, a, b); })) {}

    // Vertices of one place and one colour. `colours`: by vertex, or empty.
    ObjLines(std::span<const Index> places, std::span<const glm::vec4> colours)
        : ObjLines(find_first_same(
              places.size(),
              [&](SeededHash& hash, std::size_t i) {
                  hash.add(places[i]);
                  add_bits(hash, colours, i);
              },
              [&](std::size_t a, std::size_t b) { return places[a] == places[b] && has_same_bits(colours, a, b); })) {}

    // Calls write(i) for each value that has a line of its own, in their order.
    template <class Write>
    void for_each(Write&& write) const {
        Index lines = 0;
        for (std::size_t i = 0; i < numbers_.size(); ++i)
            if (numbers_[i] == lines + 1) ++lines, write(i);
    }
    void write(FileOutput& out, const char* keyword, const auto& values, int components) const {
        for_each([&](std::size_t i) {
            out.text(keyword);
            out.numbers(values[i], components);
            out.text("\n");
        });
    }

    bool empty() const { return numbers_.empty(); }
    std::uint64_t number(std::size_t i) const { return numbers_[i]; } // from 1 on

private:
    explicit ObjLines(std::vector<Index> first) : numbers_(std::move(first)) {
        Index lines = 0;
        for (std::size_t i = 0; i < numbers_.size(); ++i)
            numbers_[i] = numbers_[i] == i ? ++lines : numbers_[numbers_[i]];
    }

    std::vector<Index> numbers_;
};

// " V", " V/T", " V//N" or " V/T/N"; 0: the corner has none.
inline void write_obj_corner(FileOutput& out, std::uint64_t position, std::uint64_t uv, std::uint64_t normal) {
    out.text(" ");
    out.number(position);
    if (uv != 0 || normal != 0) out.text("/");
    if (uv != 0) out.number(uv);
    if (normal != 0) out.text("/");
    if (normal != 0) out.number(normal);
}

} // namespace unseen::meshio
