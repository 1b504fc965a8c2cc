#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <vector>

namespace dynamic_slam {

// For tests: weights of a Caffe network as a .caffemodel holds them, which is a NetParameter in the wire
// format of protocol buffers. A field is its key, number * 8 + type, and then, for type 2, a length and
// so many bytes. Numbers of fields are those of caffe.proto.
class CaffeModelWriter {
 public:
  // blobs: of a convolution, its weights (outputs x inputs x height x width) and its bias.
  struct Blob {
    std::vector<uint64_t> shape;
    std::vector<float> values;
  };
  void AddLayer(const std::string& name, const std::string& type, const std::vector<Blob>& blobs) {
    std::string layer = Field(1, name) + Field(2, type);  // LayerParameter.name, .type
    for (const Blob& blob : blobs) {
      std::string dimensions, data;
      for (const uint64_t dimension : blob.shape) dimensions += Varint(dimension);
      for (const float value : blob.values) {
        const uint32_t bits = std::bit_cast<uint32_t>(value);
        for (int shift = 0; shift < 32; shift += 8) data += static_cast<char>(bits >> shift & 0xff);
      }
      // LayerParameter.blobs: BlobProto.shape, with BlobShape.dim, and .data
      layer += Field(7, Field(7, Field(1, dimensions)) + Field(5, data));
    }
    net_ += Field(100, layer);  // NetParameter.layer
  }

  const std::string& bytes() const { return net_; }

 private:
  static std::string Varint(uint64_t value) {
    std::string bytes;
    for (; value >= 0x80; value >>= 7) bytes += static_cast<char>((value & 0x7f) | 0x80);
    return bytes + static_cast<char>(value);
  }
  static std::string Field(uint64_t number, const std::string& bytes) {
    return Varint(number << 3 | 2) + Varint(bytes.size()) + bytes;
  }

  std::string net_;
};

}  // namespace dynamic_slam
