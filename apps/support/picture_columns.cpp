#include "picture_columns.h"

#include <algorithm>
#include <cmath>

#include "drawing.h"

namespace unseen::app {

using perception::Image;

Result<Image> compose_columns(const std::string& title, const std::vector<PictureColumn>& columns) {
    constexpr int gap = 12, text_height = 17, line_height = 22; // pixels
    constexpr glm::vec3 paper{0.12f}, ink{0.95f}, weak{0.7f};
    int height = 0, cell_width = 0; // of the tallest column, and of the widest picture or line of text
    for (const PictureColumn& column : columns) {
        for (const std::string& line : {column.name, column.verdict})
            cell_width = std::max(cell_width, static_cast<int>(std::ceil(Drawing::text_width(line, text_height))));
        int below = 0;
        for (const Image& picture : column.pictures) {
            cell_width = std::max(cell_width, picture.width);
            below += picture.height + gap;
        }
        height = std::max(height, below);
    }
    const int count = static_cast<int>(columns.size());
    const int header = 2 * gap + line_height, above = 2 * line_height + gap;
    auto drawing = Drawing::create(gap + count * (cell_width + gap), header + above + height, paper);
    if (!drawing) return drawing.error();

    drawing->text({gap, gap}, title, ink, Drawing::fitting_height(title, text_height, drawing->width() - 2 * gap));
    for (int i = 0; i < count; ++i) {
        const int left = gap + i * (cell_width + gap);
        const PictureColumn& column = columns[static_cast<std::size_t>(i)];
        drawing->text({left, header}, column.name, ink, text_height);
        drawing->text({left, header + line_height}, column.verdict, weak, text_height);
        int top = header + above;
        for (const Image& picture : column.pictures) {
            drawing->picture({left, top}, picture);
            top += picture.height + gap;
        }
    }
    return drawing->image();
}

} // namespace unseen::app
