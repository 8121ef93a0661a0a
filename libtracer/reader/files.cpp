// Image files through OpenImageIO: see files.h.
#include "files.h"

#include <algorithm>
#include <cctype>
#include <memory>
#include <string>
#include <vector>

#include <OpenImageIO/imageio.h>

#include "model/texel_format.h"
#include "reply.h"

namespace {

// As OpenImageIO reads files of which nothing else is known.
const int strip_rows = 64;

struct File {
    std::unique_ptr<OIIO::ImageInput> input;
    OIIO::ImageSpec spec;
    int channels;
    trc_texel format;
};

// The widest of the file's channels decides.
trc_texel format_of(const OIIO::ImageSpec &spec) {
    trc_texel format = TRC_TEXEL_U8;
    const int count = spec.channelformats.empty() ? 1 : int(spec.channelformats.size());
    for (int i = 0; i < count; i++) {
        trc_texel own = TRC_TEXEL_F32;
        switch (spec.channelformat(i).basetype) {
        case OIIO::TypeDesc::UINT8:
        case OIIO::TypeDesc::INT8:
            own = TRC_TEXEL_U8;
            break;
        case OIIO::TypeDesc::UINT16:
        case OIIO::TypeDesc::INT16:
            own = TRC_TEXEL_U16;
            break;
        case OIIO::TypeDesc::HALF:
            own = TRC_TEXEL_F16;
            break;
        default:
            break;
        }
        // Whole numbers of 16 bits do not fit into half floats.
        if (own != format && own + format == TRC_TEXEL_U16 + TRC_TEXEL_F16)
            own = TRC_TEXEL_F32;
        format = std::max(format, own);
    }
    return format;
}

// Whether colours still have to be multiplied by alpha. Some readers do not say; Blender takes
// Targa, DDS and Photoshop files as not multiplied unless marked, and so does this.
bool is_unassociated(const File &file) {
    const std::string format = file.input->format_name();
    if (file.spec.get_int_attribute("oiio:UnassociatedAlpha", 0) != 0)
        return true;
    if (format == "targa")
        return file.spec.get_int_attribute("targa:alpha_type", -1) != 4;
    return format == "dds" || format == "psd";
}

OIIO::TypeDesc type_of(trc_texel format) {
    switch (format) {
    case TRC_TEXEL_U8:
        return OIIO::TypeDesc::UINT8;
    case TRC_TEXEL_U16:
        return OIIO::TypeDesc::UINT16;
    case TRC_TEXEL_F16:
        return OIIO::TypeDesc::HALF;
    default:
        return OIIO::TypeDesc::FLOAT;
    }
}

// Whether the format of files with such a name is known.
bool is_format_known(const std::string &path) {
    const size_t dot = path.find_last_of("./");
    if (dot == std::string::npos || path[dot] == '/')
        return false;
    std::string name = path.substr(dot + 1);
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return std::tolower(c); });
    // format:name,name;format:name
    std::string known = OIIO::get_string_attribute("extension_list");
    std::replace_if(
        known.begin(), known.end(), [](char c) { return c == ':' || c == ';'; }, ',');
    return ("," + known + ",").find("," + name + ",") != std::string::npos;
}

// By what is in the file, whatever its name is.
std::unique_ptr<OIIO::ImageInput> open_input(const std::string &path) {
    // Alpha is left as it is in the file: it is multiplied later, as the alpha mode says.
    OIIO::ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create(path, true, &config);
    if (!input)
        throw Failure(is_format_known(path) ? TRC_ERROR_IMAGE : TRC_ERROR_FORMAT, OIIO::geterror());
    return input;
}

File open_file(const std::string &path) {
    File file;
    file.input = open_input(path);
    file.spec = file.input->spec();
    if (file.spec.width <= 0 || file.spec.height <= 0 || file.spec.depth > 1 ||
        file.spec.nchannels <= 0)
        throw Failure(TRC_ERROR_IMAGE, "it has no pixels in two dimensions");
    file.channels = std::min(file.spec.nchannels, 4);
    file.format = format_of(file.spec);
    return file;
}

uint64_t row_bytes(const File &file) {
    return uint64_t(file.spec.width) * file.channels * type_of(file.format).size();
}

// The format with most pixels has less than 2^64 bytes: sides have 31 bits, a pixel 16 bytes.
uint64_t pixel_bytes(const File &file) { return row_bytes(file) * uint64_t(file.spec.height); }

void check_size(const File &file, const trc_reader_request &request) {
    if (pixel_bytes(file) <= request.pixel_bytes_max && row_bytes(file) <= TRC_READER_SLOT_BYTES)
        return;
    throw Failure(TRC_ERROR_TOO_LARGE, "it claims " + std::to_string(file.spec.width) + " x " +
                                           std::to_string(file.spec.height) +
                                           " pixels, which is too large for such a file");
}

// The rows of a file on their way to the library, through both slots by turns.
class Rows {
  public:
    Rows(connection &to, uint64_t row_bytes) : to_(to), row_bytes_(row_bytes) {}

    int capacity() const { return int(TRC_READER_SLOT_BYTES / row_bytes_); }

    // The slot to fill next, once the library has taken what was in it.
    char *slot() {
        if (sent_ - taken_ >= TRC_READER_SLOTS)
            await_taken();
        return to_.shared + sent_ % TRC_READER_SLOTS * TRC_READER_SLOT_BYTES;
    }

    void send(int count) {
        trc_reader_answer answer = answer_of(TRC_READER_ROWS);
        answer.slot = sent_++ % TRC_READER_SLOTS;
        answer.row_count = uint32_t(count);
        reply(to_, answer);
    }

  private:
    void await_taken() {
        trc_reader_request request;
        if (!connection_receive(&to_, &request, sizeof request, false) ||
            request.magic != TRC_READER_MAGIC || request.kind != TRC_READER_TAKEN)
            throw Gone();
        taken_++;
    }

    connection &to_;
    uint64_t row_bytes_;
    uint32_t sent_ = 0, taken_ = 0;
};

void check_read(const File &file, bool is_read) {
    if (!is_read)
        throw Failure(TRC_ERROR_IMAGE, file.input->geterror());
}

void read_scanlines(const File &file, Rows &rows) {
    const OIIO::ImageSpec &spec = file.spec;
    const int strip = std::max(1, spec.get_int_attribute("tiff:RowsPerStrip", strip_rows));
    int most = rows.capacity();
    if (most > strip)
        most -= most % strip;
    for (int y = 0; y < spec.height;) {
        const int count = std::min(most, spec.height - y), first = spec.y + y;
        check_read(file,
                   file.input->read_scanlines(0, 0, first, first + count, spec.z, 0, file.channels,
                                              type_of(file.format), rows.slot()));
        rows.send(count);
        y += count;
    }
}

// Rows of tiles may be larger than a slot.
void read_tiles(const File &file, Rows &rows) {
    const OIIO::ImageSpec &spec = file.spec;
    const int step = std::min(spec.tile_height, spec.height);
    std::vector<char> buffer(row_bytes(file) * uint64_t(step));
    for (int y = 0; y < spec.height; y += step) {
        const int count = std::min(step, spec.height - y), first = spec.y + y;
        check_read(file, file.input->read_tiles(0, 0, spec.x, spec.x + spec.width, first,
                                                first + count, spec.z, spec.z + 1, 0, file.channels,
                                                type_of(file.format), buffer.data()));
        for (int done = 0; done < count;) {
            const int part = std::min(rows.capacity(), count - done);
            std::copy_n(buffer.data() + row_bytes(file) * uint64_t(done),
                        row_bytes(file) * uint64_t(part), rows.slot());
            rows.send(part);
            done += part;
        }
    }
}

void send_info(connection &to, const File &file) {
    trc_reader_answer answer = answer_of(TRC_READER_INFO);
    answer.width = uint32_t(file.spec.width);
    answer.height = uint32_t(file.spec.height);
    answer.channels = uint32_t(file.channels);
    answer.format = file.format;
    answer.is_unassociated = is_unassociated(file);
    reply(to, answer);
}

} // namespace

void serve_file(connection &to, const trc_reader_request &request) {
    guarded(to, [&]() {
        const std::string path(to.shared, request.text_bytes[0] - 1);
        system_limit_memory(request.memory_bytes);
        const File file = open_file(path);
        check_size(file, request);
        send_info(to, file);
        system_limit_memory(
            std::min(request.memory_bytes + request.memory_per_byte * pixel_bytes(file),
                     request.memory_bytes_max));
        Rows rows(to, row_bytes(file));
        if (file.spec.tile_width > 0)
            read_tiles(file, rows);
        else
            read_scanlines(file, rows);
        reply(to, answer_of(TRC_READER_DONE));
    });
}
