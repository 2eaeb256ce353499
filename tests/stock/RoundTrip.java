// Decodes and encodes messages with the code that stock lcm-gen generates. Input: lines of type name and message in hexadecimal.
// Output: the same.
import java.io.*;
import lcm.lcm.LCMDataOutputStream;
import lcm.lcm.LCMEncodable;

public class RoundTrip {
    public static void main(String[] arguments) throws Exception {
        BufferedReader in = new BufferedReader(new InputStreamReader(System.in));
        for (String line = in.readLine(); line != null; line = in.readLine()) {
            String[] parts = line.split(" ");
            byte[] data = new byte[parts[1].length() / 2];
            for (int i = 0; i < data.length; i++) data[i] = (byte) Integer.parseInt(parts[1].substring(2 * i, 2 * i + 2), 16);
            Class<?> type = Class.forName("hoofprint." + parts[0]);
            LCMEncodable message = (LCMEncodable) type.getConstructor(byte[].class).newInstance((Object) data);
            LCMDataOutputStream out = new LCMDataOutputStream();
            message.encode(out);
            StringBuilder hex = new StringBuilder();
            for (int i = 0; i < out.size(); i++) hex.append(String.format("%02x", out.getBuffer()[i]));
            System.out.println(parts[0] + " " + hex);
        }
    }
}
