// Matches a sketch with a map and prints which object is which: sketch ADDRESS [REQUEST]
//
// REQUEST is a file with a MatchRequest in binary, in place of the one below.
package main

import (
	"context"
	"fmt"
	"io"
	"os"
	"time"

	"google.golang.org/genproto/googleapis/rpc/errdetails"
	"google.golang.org/grpc"
	"google.golang.org/grpc/credentials/insecure"
	"google.golang.org/grpc/status"
	"google.golang.org/protobuf/proto"
	"google.golang.org/protobuf/types/known/structpb"

	pb "example.com/sketch/sketchmatch/v1"
)

func main() {
	if len(os.Args) < 2 {
		fmt.Fprintln(os.Stderr, "usage: sketch ADDRESS [REQUEST]")
		os.Exit(2)
	}
	if err := run(os.Args[1], os.Args[2:]); err != nil {
		explain(err)
		os.Exit(1)
	}
}

func run(address string, files []string) error {
	connection, err := grpc.Dial(address, grpc.WithTransportCredentials(insecure.NewCredentials()))
	if err != nil {
		return err
	}
	defer connection.Close()
	request, err := request(files)
	if err != nil {
		return err
	}
	call, cancel := context.WithTimeout(context.Background(), time.Minute)
	defer cancel() // which stops the search, too
	stream, err := pb.NewMatchServiceClient(connection).Match(call, request)
	for err == nil {
		var event *pb.MatchResponse
		event, err = stream.Recv() // accepted, scenes, progress …, and at last the result
		for _, line := range event.GetResult().GetObjectMatches() {
			fmt.Printf("%d %s is %d %s, confidence %.3f\n", line.GetSketchObject(),
				line.GetSketchLabel(), line.GetMapObject(), line.GetMapLabel(), line.GetConfidence())
		}
	}
	if err == io.EOF {
		return nil
	}
	return err
}

// request returns what is to be matched: here the map shows the sketch's three objects at twice the size.
func request(files []string) (*pb.MatchRequest, error) {
	request := &pb.MatchRequest{}
	if len(files) > 0 {
		data, err := os.ReadFile(files[0])
		if err != nil {
			return nil, err
		}
		return request, proto.Unmarshal(data, request)
	}
	parameters, err := structpb.NewStruct(map[string]interface{}{"directions": 36})
	request.Pipeline = &pb.Pipeline{Histogram: &pb.AlgorithmSelection{Parameters: parameters}}
	request.Sketch = polygons( // as on a screen: y grows downwards
		pb.YAxis_Y_AXIS_DOWN, box("bed", 1, 1, 4, 2), box("desk", 7, 2, 2, 3), box("shelf", 2, 6, 1, 5))
	request.Map = polygons(
		pb.YAxis_Y_AXIS_UP, box("table", 14, 12, 4, 6), box("bunk", 2, 16, 8, 4), box("rack", 4, 0, 2, 10))
	return request, err
}

func polygons(y pb.YAxis, objects ...*pb.LabelledPolygon) *pb.Source {
	set := &pb.PolygonSet{Polygons: objects, YAxis: y}
	return &pb.Source{Kind: &pb.Source_PolygonSet{PolygonSet: set}}
}

func box(label string, x, y, width, height float64) *pb.LabelledPolygon {
	ring := &pb.Ring{Points: []*pb.Point{
		{X: x, Y: y}, {X: x + width, Y: y}, {X: x + width, Y: y + height}, {X: x, Y: y + height}}}
	return &pb.LabelledPolygon{Label: label, Rings: []*pb.Ring{ring}}
}

// explain prints what the server says of an error: a sentence for people, details for programs.
func explain(err error) {
	failed := status.Convert(err)
	fmt.Printf("error %d: %s\n", failed.Code(), failed.Message())
	for _, detail := range failed.Details() {
		switch detail := detail.(type) {
		case *errdetails.ErrorInfo:
			fmt.Println("reason", detail.GetReason())
		case *errdetails.BadRequest:
			for _, violation := range detail.GetFieldViolations() {
				fmt.Println("field", violation.GetField())
			}
		case *errdetails.RetryInfo:
			fmt.Println("retry after", detail.GetRetryDelay().AsDuration())
		}
	}
}
